"""The real firmware on a simulated ATmega328P, behind an object shaped like `serial.Serial`, in virtual time.

Time passes only while something runs the board: `run`, or a `read` that waits. Nothing depends on the machine's speed.
"""

import ctypes
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

FREQUENCY = 16_000_000
"""Of the processor [Hz]."""

BOARD_PINS = ("D9", "D10", "D11", "D5", "D6", "D7")
"""Of servos 0 to 5."""


class _Edge(ctypes.Structure):
    _fields_ = (("cycle", ctypes.c_uint64), ("servo", ctypes.c_uint32), ("high", ctypes.c_uint32))


@dataclass(frozen=True)
class Pulse:
    """A pulse of a servo pin.

    Attributes:
        servo: Number of the servo.
        start: When it began [s].
        width: How long it lasted [us].
    """

    servo: int
    start: float
    width: float

    @property
    def end(self) -> float:
        """When it ended [s]."""
        return self.start + 1e-6 * self.width


class BoardStoppedError(Exception):
    """The processor crashed or went to sleep for ever."""


class SimulatedBoard:
    """A board that runs a firmware, seen from the host's end of the line.

    Attributes:
        timeout: How long `read` waits [s, virtual].
        baudrate: Of the host.
    """

    def __init__(self, library: Path, elf: Path, *, baudrate: int = 115200, timeout: float = 0.1) -> None:
        """`library`: compiled simulated_board.c. `elf`: the firmware."""
        self._c = _load(library)
        self._board = self._c.board_new(str(elf).encode(), float(baudrate))
        if not self._board:
            raise BoardStoppedError(f"simavr cannot load {elf}")
        self.timeout, self.baudrate = timeout, baudrate
        self._elf, self._seed = elf, 0
        self._rises: list[int | None] = [None] * len(BOARD_PINS)
        self._pulses: list[Pulse] = []
        self._buffer = bytearray()
        self.arrivals: list[float] = []
        """When each byte of the host's buffer came [s]."""
        self.power_cycle()

    def close(self) -> None:
        """Free the simulator."""
        if self._board:
            self._c.board_free(self._board)
            self._board = None

    @property
    def now(self) -> float:
        """Virtual time since the board was switched on [s]."""
        return self._c.board_cycle(self._board) / FREQUENCY

    def run(self, duration: float) -> None:
        """Let `duration` [s] pass."""
        self._run_to(self._c.board_cycle(self._board) + round(duration * FREQUENCY))

    def write(self, data: bytes, *, bad_stop_bits: Sequence[int] = ()) -> int:
        """Send `data`, each byte as soon as the line is free; those at `bad_stop_bits` with a framing error."""
        values = [byte | (0x8000 if i in bad_stop_bits else 0) for i, byte in enumerate(data)]
        array = (ctypes.c_uint16 * len(values))(*values)
        if self._c.board_send(self._board, array, len(values), self._c.board_cycle(self._board)):
            raise OverflowError("more bytes waiting than the simulated line holds")
        return len(data)

    @property
    def in_waiting(self) -> int:
        """Bytes that have come from the board."""
        self._collect()
        return len(self._buffer)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes; if fewer are there, let at most `timeout` pass until they are."""
        end = self._c.board_cycle(self._board) + round(self.timeout * FREQUENCY)
        while self.in_waiting < size and (now := self._c.board_cycle(self._board)) < end:
            arrival = self._c.board_next_arrival(self._board) or now + FREQUENCY // 10_000
            self._run_to(min(max(arrival, now + 1), end))
        data = bytes(self._buffer[:size])
        del self._buffer[:size], self.arrivals[:size]
        return data

    def reset_input_buffer(self) -> None:
        """Forget what has come."""
        self._collect()
        self._buffer.clear()
        self.arrivals.clear()

    def vanish(self) -> None:
        """The host dies: what it has not sent yet stays unsent, also in the midst of a frame."""
        self._c.board_cut(self._board)

    def reset(self) -> None:
        """Press the reset button: the memory keeps what it has."""
        self._c.board_reset(self._board)

    def power_cycle(self) -> None:
        """Switch the board off and on: what its memory holds then is anything."""
        self._seed += 1
        self._c.board_power(self._board, self._seed)

    def hang(self, function: str) -> Callable[[], None]:
        """Let the firmware stop for ever where it calls `function`; return what undoes that."""
        address = _address(self._elf, function)
        before = self._c.board_word(self._board, address)
        self._c.board_set_word(self._board, address, 0xCFFF)  # rjmp to itself
        return lambda: self._c.board_set_word(self._board, address, before)

    def pulses(self) -> list[Pulse]:
        """Return the pulses that ended since the last call, in the order of their ends."""
        array = (_Edge * (1 << 16))()
        for edge in array[: self._c.board_edges(self._board, array)]:
            rise = self._rises[edge.servo]
            if edge.high:
                self._rises[edge.servo] = edge.cycle
            elif rise is not None:
                width = 1e6 * (edge.cycle - rise) / FREQUENCY
                self._pulses.append(Pulse(edge.servo, rise / FREQUENCY, width))
                self._rises[edge.servo] = None
        if self._c.board_lost(self._board):
            raise OverflowError("more edges or bytes than the simulated board keeps")
        pulses, self._pulses = self._pulses, []
        return pulses

    def memory(self, address: int) -> int:
        """Return a byte of the data memory, registers included."""
        return self._c.board_memory(self._board, address)

    def set_memory(self, address: int, value: int) -> None:
        """Set a byte of the data memory."""
        self._c.board_set_memory(self._board, address, value)

    def set_pin(self, port: str, pin: int, high: bool) -> None:
        """Drive an input pin from outside."""
        self._c.board_set_pin(self._board, port.encode(), pin, high)

    def _run_to(self, cycle: int) -> None:
        if self._c.board_run(self._board, cycle):
            raise BoardStoppedError(f"the processor stopped after {self.now:.6f} s")

    def _collect(self) -> None:
        values, cycles = (ctypes.c_uint8 * 4096)(), (ctypes.c_uint64 * 4096)()
        while count := self._c.board_receive(self._board, values, cycles, 4096):
            self._buffer += bytes(values[:count])
            self.arrivals += [cycle / FREQUENCY for cycle in cycles[:count]]


def _address(elf: Path, function: str) -> int:
    listing = subprocess.run(["avr-nm", elf], capture_output=True, text=True, check=True).stdout
    return next(int(a, 16) for a, _, name in map(str.split, listing.splitlines()) if name == function)


def _load(library: Path) -> ctypes.CDLL:
    c = ctypes.CDLL(str(library))
    board, cycle, number = ctypes.c_void_p, ctypes.c_uint64, ctypes.c_uint32
    for name, result, arguments in (
        ("new", board, [ctypes.c_char_p, ctypes.c_double]),
        ("free", None, [board]),
        ("cycle", cycle, [board]),
        ("run", ctypes.c_int, [board, cycle]),
        ("send", ctypes.c_int, [board, ctypes.POINTER(ctypes.c_uint16), number, cycle]),
        ("cut", None, [board]),
        (
            "receive",
            number,
            [board, ctypes.POINTER(ctypes.c_uint8), ctypes.POINTER(ctypes.c_uint64), number],
        ),
        ("next_arrival", cycle, [board]),
        ("edges", number, [board, ctypes.POINTER(_Edge)]),
        ("lost", number, [board]),
        ("reset", None, [board]),
        ("power", None, [board, number]),
        ("word", ctypes.c_uint16, [board, number]),
        ("set_word", None, [board, number, ctypes.c_uint16]),
        ("memory", ctypes.c_uint8, [board, ctypes.c_uint16]),
        ("set_memory", None, [board, ctypes.c_uint16, ctypes.c_uint8]),
        ("set_pin", None, [board, ctypes.c_char, ctypes.c_int, ctypes.c_int]),
    ):
        function = getattr(c, f"board_{name}")
        function.restype, function.argtypes = result, arguments
    return c
