"""The driver on a pseudo-terminal that stands for the port of an Uno: opening it resets the board."""

import sys

from tripod_driver.node import main
from tripod_driver.ports.serial_port import SerialPort

SerialPort.resets = property(lambda _port: True, lambda _port, _found: None)  # type: ignore[assignment]

if __name__ == "__main__":
    sys.exit(main())
