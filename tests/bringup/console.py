"""A console for commands that servos and somebody at a terminal share."""


class Script:
    """A console that presses keys at given times, and remembers what it was shown."""

    patience = 60.0

    def __init__(self, keys: dict[float, bytes]) -> None:
        self.keys, self.now = dict(keys), 0.0
        self.lines: list[str] = []
        self.said: list[str] = []

    def read(self) -> bytes:
        due = sorted(at for at in self.keys if at <= self.now)
        return b"".join(self.keys.pop(at) for at in due)

    def show(self, line: str) -> None:
        self.lines.append(line)

    def print(self, text: str) -> None:
        self.said.append(text)

    def clock(self) -> float:
        return self.now

    def sleep(self, duration: float) -> None:
        self.now += duration
        assert self.now < self.patience, f"it does not end: {self.lines[-1]}"
