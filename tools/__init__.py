"""What `make` runs: set up `.venv`, build the messages, keep the pins. Standard library only, no part of the suite."""
