"""Where the bytes go: a serial port, a pseudo-terminal or memory, behind one interface."""
