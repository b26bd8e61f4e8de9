"""Builds what the tests of the firmware need, or says which packages are absent."""

import atexit
import os
import shutil
import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "firmware"

REQUIRED = "TRIPOD_REQUIRE_FIRMWARE_TESTS"
"""Environment variable: where it is set, as in continuous integration, a test that would be skipped fails."""

_PROGRAMS = {"make": "make", "cc": "gcc libc6-dev", "avr-gcc": "gcc-avr", "avr-size": "binutils-avr"}
_HEADERS = {
    "avr/io.h": ("avr-gcc -mmcu=atmega328p", "avr-libc"),
    "simavr/sim_avr.h": ("cc", "libsimavr-dev"),
    "libelf.h": ("cc", "libelf-dev"),
}
NATIVE, AVR, SIMULATOR = ("make", "cc"), ("avr-gcc", "avr-size", "avr/io.h"), ("simavr/sim_avr.h", "libelf.h")


@cache
def absent(needs: tuple[str, ...]) -> str:
    """Return the Debian packages that bring what is absent of `needs`, programs and headers."""
    packages = [_PROGRAMS[need] for need in needs if need in _PROGRAMS and not shutil.which(need)]
    for need in needs:
        if need in _HEADERS:
            compiler, package = _HEADERS[need]
            if not shutil.which(compiler.split()[0]) or not _compiles(compiler, need):
                packages.append(package)
    return " ".join(packages)


def _compiles(compiler: str, header: str) -> bool:
    command = [*compiler.split(), "-fsyntax-only", "-xc", "-"]
    code = f"#include <{header}>"
    return subprocess.run(command, input=code, text=True, capture_output=True, check=False).returncode == 0


def need(*needs: str) -> None:
    """Skip the test, or fail where REQUIRED is set, unless all of `needs` is there."""
    if packages := absent(needs):
        message = f"not installed; to enable: sudo apt-get install {packages}"
        if os.environ.get(REQUIRED):
            pytest.fail(f"{REQUIRED} is set and this test cannot run: {message}", pytrace=False)
        pytest.skip(message)


@cache
def _directory() -> Path:
    path = Path(mkdtemp(prefix="tripod_firmware_"))

    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


@cache
def firmware(**parameters: int) -> Path:
    """Return the ELF file of the firmware, built with `parameters` of its Makefile."""
    need("make", *AVR)
    name = "-".join(["firmware", *(f"{key}={value}" for key, value in parameters.items())])
    arguments = [f"{key}={value}" for key, value in parameters.items()]
    build(["make", "-s", "-C", str(SOURCES), f"BUILD={_directory() / name}", *arguments])
    return _directory() / name / "tripod.elf"


@cache
def workshop() -> Path:
    """Return the ELF file of workshop.c: what the workshop's boards do."""
    need(*AVR)
    elf = _directory() / "workshop.elf"
    flags = ["-mmcu=atmega328p", "-DF_CPU=16000000UL", "-Os", "-std=gnu11", "-Wall", "-Wextra", "-Werror"]
    build(["avr-gcc", *flags, str(HERE / "workshop.c"), "-o", str(elf)])
    return elf


@cache
def simulator() -> Path:
    """Return the library of simulated_board.c."""
    need("cc", *SIMULATOR)
    library = _directory() / "simulated_board.so"
    flags = ["-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    build(["cc", *flags, str(HERE / "simulated_board.c"), "-o", str(library), "-lsimavr", "-lelf"])
    return library


@cache
def native(servos: int = 3, winches: int = 0, pressures: int = 0) -> Path:
    """Return the program of native_protocol.c: the protocol's C code on this machine, with sanitizers."""
    need("cc")
    program = _directory() / f"native_protocol-{servos}-{winches}-{pressures}"
    flags = [
        "-O1",
        "-g",
        "-std=c11",
        "-fshort-enums",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-fsanitize=address,undefined",
    ]
    sources = [
        HERE / "native_protocol.c",
        *(SOURCES / f"{name}.c" for name in ("protocol", "channels", "frame")),
    ]
    flags += ["-fno-sanitize-recover=all", f"-I{SOURCES}", f"-DSERVO_COUNT={servos}"]
    flags += [f"-DWINCH_COUNT={winches}", f"-DPRESSURE_COUNT={pressures}"]
    build(["cc", *flags, *map(str, sources), "-o", str(program)])
    return program


def build(command: list[str]) -> None:
    """Run a compiler; show what it says if it fails."""
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"{' '.join(command)}\n{run.stdout}{run.stderr}"
