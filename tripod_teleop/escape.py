"""From the bytes that a terminal sends to the keys that were pressed."""

from enum import Enum, auto

ESCAPE = 0x1B
ARROWS = {"A": "up", "B": "down", "C": "right", "D": "left", "H": "home", "F": "end"}
KEYPAD = {"j": "*", "k": "+", "l": ",", "m": "-", "n": ".", "o": "/", "M": "enter"}
CONTROLS = {0x00: "ctrl+space", 0x08: "backspace", 0x0A: "enter", 0x0D: "enter", 0x7F: "backspace"}
CONTROLS |= {code: f"ctrl+{chr(code + 0x40).lower()}" for code in range(0x01, 0x20) if code not in CONTROLS}
LONGEST = 32
"""Longest sequence that is understood; a longer one is skipped to its end [B]."""
PASTE_BEGIN, PASTE_END = "200", "201"


class _State(Enum):
    TEXT = auto()
    ESCAPE = auto()  # after ESC
    SEQUENCE = auto()  # after ESC [
    KEYPAD = auto()  # after ESC O
    SKIP = auto()  # within bytes that belong to a sequence but have no meaning here


class KeyParser:
    """Takes bytes as they come, however they are split, and gives keys.

    A key is a character ("a", "A", "+"), a name ("up", "space", "enter", "escape") or either behind "ctrl+", "alt+" or
    "shift+", as in "ctrl+up"; Ctrl with a letter is "ctrl+a", and Tab is "ctrl+i", which terminals do not tell apart.
    Understood are xterm's sequences (cursor and application mode, modifyOtherKeys, CSI u), rxvt's Ctrl with arrows and
    the keypad's plus and minus. Sequences that mean nothing here, bytes beyond ASCII and pasted text give no keys.

    Time plays no role: on a slow line a sequence may be torn at any place, and its last letter must never count as a
    key. So Escape alone gives nothing; the key after it is "alt+" that key.
    """

    def __init__(self) -> None:
        self._state = _State.TEXT
        self._held = ""
        self._skip = 0
        self._pasting = False

    def feed(self, data: bytes) -> list[str]:
        """Take the next bytes and return the keys that they complete."""
        keys = []
        for byte in data:
            key = self._take(byte)
            if key and not self._pasting:
                keys.append(key)
        return keys

    def _take(self, byte: int) -> str:
        if byte == ESCAPE:
            twice = self._state is _State.ESCAPE
            self._begin(_State.ESCAPE)
            return "escape" if twice else ""
        match self._state:
            case _State.TEXT:
                return _plain(byte)
            case _State.ESCAPE:
                return self._after_escape(byte)
            case _State.SKIP:
                self._skip -= 1
                if self._skip == 0:
                    self._begin(_State.TEXT)
                return ""
        return self._in_sequence(byte)

    def _begin(self, state: _State) -> None:
        self._state, self._held = state, ""

    def _after_escape(self, byte: int) -> str:
        if byte == ord("["):
            self._begin(_State.SEQUENCE)
            return ""
        if byte == ord("O"):
            self._begin(_State.KEYPAD)
            return ""
        self._begin(_State.TEXT)
        key = _plain(byte)
        return f"alt+{key}" if key else ""

    def _in_sequence(self, byte: int) -> str:
        keypad = self._state is _State.KEYPAD
        parameter = 0x30 <= byte <= 0x3F if keypad else 0x20 < byte <= 0x3F
        if parameter:
            self._held += chr(byte) if len(self._held) <= LONGEST else ""
            return ""
        held = self._held
        self._begin(_State.TEXT)
        if not 0x20 < byte <= 0x7E:  # no key's sequence has such a byte: it was torn off here
            return _plain(byte)
        if len(held) > LONGEST:
            return ""
        return _keypad_key(chr(byte), held) if keypad else self._end_sequence(chr(byte), held)

    def _end_sequence(self, final: str, held: str) -> str:
        if not held and final in "[M":  # a function key of the Linux console; the mouse of old terminals
            self._state, self._skip = _State.SKIP, 1 if final == "[" else 3
            return ""
        if final == "~" and held in (PASTE_BEGIN, PASTE_END):
            self._pasting = held == PASTE_BEGIN
            return ""
        return _sequence_key(final, held)


def _plain(byte: int) -> str:
    if byte == 0x20:
        return "space"
    if 0x21 <= byte <= 0x7E:
        return chr(byte)
    return CONTROLS.get(byte, "")


def _keypad_key(final: str, held: str) -> str:
    if final in "abcd" and not held:  # rxvt
        return "ctrl+" + ARROWS[final.upper()]
    name = ARROWS.get(final) or KEYPAD.get(final, "")
    return _modified(name, held.rsplit(";", maxsplit=1)[-1]) if name else ""


def _sequence_key(final: str, held: str) -> str:
    numbers = held.split(";")
    if final in ARROWS and len(numbers) <= 2:
        return _modified(ARROWS[final], numbers[1] if len(numbers) == 2 else "")
    if final == "u" and len(numbers) <= 2:  # CSI code ; modifiers u
        return _modified(_character(numbers[0]), numbers[1] if len(numbers) == 2 else "")
    if final == "~" and len(numbers) == 3 and numbers[0] == "27":  # CSI 27 ; modifiers ; code ~
        return _modified(_character(numbers[2]), numbers[1])
    return ""


def _character(code: str) -> str:
    return _plain(int(code)) if code.isascii() and code.isdigit() and int(code) < 0x80 else ""


def _modified(name: str, modifiers: str) -> str:
    if not modifiers or not name:
        return name
    if not (modifiers.isascii() and modifiers.isdigit() and 1 <= int(modifiers) <= 8):
        return ""
    bits = int(modifiers) - 1
    shift = "shift+" if bits & 1 and len(name) > 1 else ""  # a character is shifted already
    return ("ctrl+" if bits & 4 else "") + ("alt+" if bits & 2 else "") + shift + name
