"""What docs/protocol.md says of the board, in Python, on the codec of the driver: the yardstick of the C code."""

from binascii import crc_hqx
from dataclasses import dataclass, field

from tripod_driver.framed import (
    VERSION,
    Acknowledgement,
    BoardState,
    Error,
    ErrorCode,
    Flags,
    HelloReply,
    ImuLine,
    ResetCause,
    cobs_decode,
    encode,
)

PULSE_MIN, PULSE_MAX, WATCHDOG, SLEW = 5440, 24000, 500, 475
NEAR, ROW = 10, 3
EMITTING = (BoardState.ACTIVE, BoardState.HOLDING)


def legacy_pulse(degrees: int) -> int:
    """The Arduino Servo library's pulse [0.1 us]: map(degrees, 0, 180, 544, 2400) in whole microseconds."""
    return 10 * (degrees * (2400 - 544) // 180 + 544)


@dataclass
class ModelBoard:
    """A board without a processor: bytes and milliseconds in; replies, state and pulses out."""

    servos: int = 3
    state: BoardState = BoardState.IDLE
    emitted: tuple[int, ...] = ()
    target: tuple[int, ...] = ()
    flags: Flags = Flags.RESTARTED
    dropped: int = 0
    framed: bool = False
    _sequence: int = 0
    _imu_sequence: int = 0
    _since_command: int = 0
    _piece: bytearray = field(default_factory=bytearray)
    _lost: bool = False
    _packet: list[int] | None = None
    _last: tuple[int, ...] = ()
    _row: int = 0

    def __post_init__(self) -> None:
        """Nobody knows the pulses yet."""
        self.emitted = self.target = (0,) * self.servos

    @property
    def pulses(self) -> tuple[int, ...]:
        """Those of the next period."""
        return tuple(
            min(max(to, at - SLEW), at + SLEW) if at else to
            for at, to in zip(self.emitted, self.target, strict=True)
        )

    @property
    def told(self) -> tuple[int, ...]:
        """The pulses in a reply."""
        return self.pulses if self.state in EMITTING else self.emitted

    def period(self) -> None:
        if self.state in EMITTING:
            self.emitted = self.pulses

    def receive(self, data: bytes) -> bytes:
        return b"".join(self._byte(byte) for byte in data)

    def tick(self) -> None:
        self._since_command += 1
        if self.state in EMITTING and self._since_command > WATCHDOG:
            self.flags |= Flags.WATCHDOG
            if self._since_command <= 2 * WATCHDOG:
                self.state, self.target = BoardState.HOLDING, self.pulses
            else:
                self.state = BoardState.RELEASED

    def lose_input(self) -> None:
        self.flags |= Flags.OVERRUN
        self._lost, self._packet = True, None

    def lose_output(self) -> None:
        self.flags |= Flags.OVERRUN

    def imu_line(self, text: str) -> bytes:
        if not self.framed:
            return text.encode() + b"\n"
        self._imu_sequence += 1
        return encode(ImuLine(text), (self._imu_sequence - 1) % 256)

    def _byte(self, byte: int) -> bytes:
        if self.servos == 3 and not self.framed:
            self._legacy(byte)
        if byte:
            self._piece.append(byte)
            return b""
        piece, lost = bytes(self._piece), self._lost
        self._piece.clear()
        self._lost = False
        if not piece and not lost:
            return b""
        body = None if lost else sound_body(piece)
        if body is None:
            self.dropped = (self.dropped + self.framed) % 65536
            return b""
        return self._frame(body)

    def _frame(self, body: bytes) -> bytes:
        if len(body) < 3 or body[1] >= 0x80:
            self.dropped = (self.dropped + 1) % 65536
            return b""
        version, kind, sequence, payload = body[0], body[1], body[2], body[3:]
        if self.framed and sequence != self._sequence:
            self.flags |= Flags.SEQUENCE_GAP
        self._sequence, self.framed = (sequence + 1) % 256, True
        return encode(self._carry_out(version, kind, payload), sequence)

    def _carry_out(self, version: int, kind: int, payload: bytes) -> HelloReply | Acknowledgement | Error:
        if version != VERSION:
            return Error(ErrorCode.VERSION, kind, VERSION)
        if kind not in (1, 2, 3, 4):
            return Error(ErrorCode.TYPE, kind, kind)
        if len(payload) != (2 * self.servos if kind == 2 else 0):
            return Error(ErrorCode.LENGTH, kind, len(payload))
        if kind == 1:
            flags, self.flags = self.flags, Flags(0)
            limits = (PULSE_MIN, PULSE_MAX, WATCHDOG, SLEW)
            told = (ResetCause.POWER_ON, self.state, flags, self.told)
            return HelloReply((2, 2), VERSION, self.servos, *limits, *told)
        if kind == 2:
            asked = [int.from_bytes(payload[i : i + 2], "little") for i in range(0, len(payload), 2)]
            for servo, pulse in enumerate(asked):
                if not PULSE_MIN <= pulse <= PULSE_MAX:
                    return Error(ErrorCode.PULSE, kind, servo)
            self.target = tuple(5 * ((pulse + 2) // 5) for pulse in asked)
            self.state = BoardState.ACTIVE
        if kind == 3 and self.state in EMITTING:
            self.state, self.target = BoardState.HOLDING, self.pulses
        if kind == 4:
            self.state = BoardState.RELEASED
        self._since_command = 0
        flags, self.flags = self.flags, Flags(0)
        return Acknowledgement(self.state, flags, self.told, self.dropped)

    def _legacy(self, byte: int) -> None:
        if byte == 255:
            if self._packet is None or len(self._packet) < 3:
                self._row = 0
            self._packet = []
        elif self._packet is None or len(self._packet) == 3 or byte > 180:
            self._packet = None
        else:
            self._packet.append(byte)
            if len(self._packet) == 3:
                packet, last = tuple(self._packet), self._last
                agree = bool(self._row) and all(abs(x - y) <= NEAR for x, y in zip(packet, last, strict=True))
                if self._row < ROW:
                    self._row = self._row + 1 if agree else 1
                self._last = packet
                if self._row == ROW:
                    self.target = tuple(map(legacy_pulse, packet))
                    self.state, self._since_command = BoardState.ACTIVE, 0


def sound_body(piece: bytes) -> bytes | None:
    """What stands between two delimiters, without its CRC, if that is right."""
    body = cobs_decode(piece) if len(piece) <= 41 else None
    if body is None or len(body) < 2 or crc_hqx(body[:-2], 0xFFFF) != int.from_bytes(body[-2:], "little"):
        return None
    return body[:-2]
