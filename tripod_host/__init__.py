"""What every part asks of the machine it runs on: files, locks, signals. Standard library only."""
