"""A scene held against what was measured: scores, values identified with their bars, what the data cannot tell."""
