"""The speed of the line: that of the protocol, unless it is given."""

import os
import termios
import tty

import pytest

pytest.importorskip("rclpy")

from tripod_driver.settings import PARAMETERS, make_driver

DEFAULTS = {p.name: p.default for p in PARAMETERS}


@pytest.mark.parametrize(
    ("changed", "speed"),
    [
        ({"protocol": "framed"}, termios.B115200),
        ({"protocol": "legacy"}, termios.B115200),
        ({"protocol": "ascii"}, termios.B57600),
        ({"protocol": "ascii", "baud": 9600}, termios.B9600),
    ],
)
def test_the_port_is_opened_at_the_speed_of_the_protocol(changed: dict[str, object], speed: int) -> None:
    near, far = os.openpty()
    tty.setraw(far)
    try:
        driver = make_driver({**DEFAULTS, "port": os.ttyname(far), **changed})
        driver.connect()
        driver.tick(0.0)
        line = termios.tcgetattr(near)
        driver.disconnect(0.0)
    finally:
        os.close(near)
        os.close(far)
    assert line[4:6] == [speed, speed]
    assert line[2] & termios.CSIZE == termios.CS8
    assert line[2] & (termios.PARENB | termios.CSTOPB) == 0
