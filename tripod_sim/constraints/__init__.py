"""Node groups tied exactly, and the elimination of what they tie."""
