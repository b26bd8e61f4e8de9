"""The steps of the set-up: each done once for its inputs, and made good after any interruption."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from tests.messages import assert_names, raises_naming
from tools import environment
from tools.command import Shell
from tools.errors import StepError
from tools.ros_source import RosSource
from tools.state import SetupState, key_of

ROOT = Path(__file__).parents[2]
ALL = ["environment", "packages", "interfaces", "messages", "loops"]


class FakeJob:
    """Stands for what compiles beside the other steps."""

    killed = 0

    def __init__(self, end: Callable[[], None]) -> None:
        self.end = end

    def kill(self) -> None:
        FakeJob.killed += 1


class Checkout:
    """A checkout whose steps only note that they ran, and fail as told."""

    def __init__(self, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        self.root, self.venv = root, root / ".venv"
        self.ran: list[str] = []
        self.trouble: dict[str, BaseException] = {}
        for name in ("msgs", "interfaces"):
            shutil.copytree(ROOT / name, root / name)
        for name in ("pyproject.toml", "constraints.txt", "package.xml"):
            shutil.copy(ROOT / name, root)
        (root / "tripod_sim").mkdir()
        shutil.copy(ROOT / "tripod_sim/system_kernels.py", root / "tripod_sim")
        monkeypatch.setattr(environment, "ROOT", root)
        monkeypatch.setattr(environment, "VENV", self.venv)
        monkeypatch.setattr(environment, "LOG", self.venv / "setup.log")
        monkeypatch.setattr(environment, "find_ros", lambda *_: RosSource(None))
        monkeypatch.setattr(environment, "missing_things", lambda *_, **__: [])
        monkeypatch.setattr(environment, "_create_environment", lambda *_: self._run("environment"))
        monkeypatch.setattr(environment, "_install_packages", lambda *_: self._run("packages"))
        monkeypatch.setattr(environment, "_install_interfaces", lambda *_: self._run("interfaces"))
        monkeypatch.setattr(environment, "_install_messages", lambda *_: self._run("messages"))
        monkeypatch.setattr(environment, "_install_libraries", lambda *_: None)
        monkeypatch.setattr(environment, "_start_loops", lambda *_: FakeJob(lambda: self._run("loops")))

    def _run(self, step: str) -> None:
        self.ran.append(step)
        if step == "environment":
            (self.venv / "bin").mkdir(parents=True, exist_ok=True)
            python = self.venv / "bin" / "python"
            python.unlink(missing_ok=True)
            python.symlink_to(sys.executable)
        if step in self.trouble:
            raise self.trouble[step]

    def set_up(self) -> list[str]:
        """Run the set-up; return the steps that it ran."""
        self.ran.clear()
        self.code = environment.main()
        return list(self.ran)


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Checkout:
    return Checkout(tmp_path, monkeypatch)


def until(condition: Callable[[], object]) -> None:
    """Wait until `condition()` is true, or fail after a minute."""
    end = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def runs(process: int) -> bool:
    """Return whether a process is there, and no zombie."""
    try:
        return " Z " not in Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    except (FileNotFoundError, ProcessLookupError):
        return False


def append(path: Path, text: str) -> None:
    path.write_text(path.read_text(encoding="utf-8") + text, encoding="utf-8")


def test_a_second_set_up_does_nothing(checkout: Checkout, capsys: pytest.CaptureFixture[str]) -> None:
    assert checkout.set_up() == ALL
    assert checkout.code == 0
    capsys.readouterr()
    assert checkout.set_up() == []
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert_names(out, "setup: ", ".venv", "up to date")


def test_a_changed_message_rebuilds_the_messages_alone(checkout: Checkout) -> None:
    checkout.set_up()
    append(checkout.root / "msgs/msg/BodyState.msg", "float64 more\n")
    assert checkout.set_up() == ["messages"]
    (checkout.root / "msgs/msg/New.msg").write_text("uint8 x\n", encoding="utf-8")
    assert checkout.set_up() == ["messages"]
    (checkout.root / "msgs/msg/New.msg").unlink()
    assert checkout.set_up() == ["messages"]


def test_a_changed_interface_of_others_rebuilds_what_may_use_it(checkout: Checkout) -> None:
    checkout.set_up()
    append(checkout.root / "interfaces/tf2_msgs/msg/TFMessage.msg", "float64 more\n")
    assert checkout.set_up() == ["interfaces", "messages"]


@pytest.mark.parametrize("name", ["constraints.txt", "a new package"])
def test_changed_packages_are_installed_and_the_messages_built_on_them(checkout: Checkout, name: str) -> None:
    checkout.set_up()
    if name == "constraints.txt":
        append(checkout.root / name, "somelibrary==1.0\n")
    else:
        (checkout.root / "tripod_new").mkdir()
        (checkout.root / "tripod_new" / "__init__.py").touch()
    assert checkout.set_up() == ALL[1:]
    assert checkout.set_up() == []


def test_a_changed_loop_is_compiled_and_nothing_else(checkout: Checkout) -> None:
    checkout.set_up()
    append(checkout.root / "tripod_sim/system_kernels.py", "# another\n")
    assert checkout.set_up() == ["loops"]
    (checkout.root / "tripod_sim/without_loops.py").write_text("# nothing to compile\n", encoding="utf-8")
    assert checkout.set_up() == []


def test_settings_of_tools_reinstall_nothing(checkout: Checkout) -> None:
    checkout.set_up()
    append(checkout.root / "pyproject.toml", "\n[tool.something]\nx = 1\n")
    assert checkout.set_up() == []


def test_another_python_makes_the_environment_anew(
    checkout: Checkout, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkout.set_up()
    monkeypatch.setattr(sys, "version", "3.12.0 (another)")
    assert checkout.set_up() == ALL


def test_a_lost_python_makes_the_environment_anew(checkout: Checkout) -> None:
    checkout.set_up()
    (checkout.venv / "bin" / "python").unlink()
    assert checkout.set_up() == ALL


@pytest.mark.parametrize("step", ["environment", "packages"])
def test_what_an_interruption_left_half_written_is_made_anew(checkout: Checkout, step: str) -> None:
    checkout.trouble = {step: KeyboardInterrupt()}
    checkout.set_up()
    assert checkout.code == 130
    assert SetupState(checkout.venv).interrupted == step
    checkout.trouble = {}
    assert checkout.set_up() == ALL
    assert checkout.set_up() == []


def test_after_interrupted_messages_the_rest_is_made(checkout: Checkout) -> None:
    checkout.trouble = {"messages": KeyboardInterrupt()}
    checkout.set_up()
    checkout.trouble = {}
    assert checkout.set_up() == ["messages", "loops"]


def test_a_download_that_fails_is_tried_again_in_the_same_environment(
    checkout: Checkout, capsys: pytest.CaptureFixture[str]
) -> None:
    checkout.trouble = {"packages": StepError("python failed with exit code 1:\n  | no network")}
    assert checkout.set_up() == ["environment", "packages"]
    assert checkout.code == 1
    assert_names(capsys.readouterr().err, "exit code 1", "| no network")
    checkout.trouble = {}
    assert checkout.set_up() == ALL[1:]


def test_what_compiles_beside_ends_with_the_set_up(checkout: Checkout) -> None:
    before = FakeJob.killed
    checkout.trouble = {"packages": StepError("no network")}
    checkout.set_up()
    assert FakeJob.killed == before + 1
    assert "loops" not in checkout.ran


def test_a_job_beside_others_is_told_in_the_log_and_ends_with_all_it_started(tmp_path: Path) -> None:
    shell = Shell(os.environ, tmp_path / "setup.log", os.open(tmp_path, os.O_RDONLY))
    job = shell.start(sys.executable, "-c", "print('as told')")
    job.end()
    job.kill()
    assert "as told" in shell.log.read_text(encoding="utf-8")
    job = shell.start(sys.executable, "-c", "print('trouble'); raise SystemExit(3)")
    with raises_naming(StepError, "exit code 3", "| trouble"):
        job.end()
    words = (
        "import subprocess, sys; p = subprocess.Popen(['sleep', '1000']); print(p.pid, flush=True); p.wait()"
    )
    job = shell.start(sys.executable, "-c", words)
    until(lambda: job.said.read_text(encoding="utf-8").endswith("\n"))
    child = int(job.said.read_text(encoding="utf-8"))
    job.kill()
    until(lambda: not runs(child))
    assert not job.said.exists()


def test_an_environment_that_somebody_else_made_is_taken_over_if_it_works(checkout: Checkout) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(checkout.venv)], check=True)
    assert checkout.set_up() == ALL, "without pip it is of no use"
    shutil.rmtree(checkout.venv)
    subprocess.run([sys.executable, "-m", "venv", str(checkout.venv)], check=True)
    assert checkout.set_up() == ALL[1:]


def test_the_environment_of_another_checkout_is_left_alone(
    checkout: Checkout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "kept").touch()
    checkout.venv.symlink_to(other)
    assert checkout.set_up() == []
    assert checkout.code == 2
    assert_names(capsys.readouterr().err, checkout.venv, "link", other)
    assert [path.name for path in other.iterdir()] == ["kept"]


@pytest.mark.parametrize("content", ["", "not json", "[1]", '{"packages": 1}'])
def test_a_damaged_note_counts_as_nothing_done(checkout: Checkout, content: str) -> None:
    checkout.set_up()
    (checkout.venv / SetupState.FILE).write_text(content, encoding="utf-8")
    assert "packages" in checkout.set_up()


def test_a_program_that_outlives_a_killed_set_up_keeps_the_next_one_waiting(tmp_path: Path) -> None:
    hold = (
        "import os; from pathlib import Path; from tools import environment; from tools.command import Shell\n"
        f"environment.ROOT = folder = Path({str(tmp_path)!r})\n"
        "with environment._lock() as lock:\n"
    )
    install = hold + (
        "    shell = Shell(os.environ, folder / 'log', lock)\n"
        "    shell.run('sh', '-c', f'echo $$ > {folder}/new && mv {folder}/new {folder}/pid && exec sleep 600')\n"
    )
    killed = subprocess.Popen([sys.executable, "-c", install], cwd=ROOT)
    until((tmp_path / "pid").exists)
    installer = int((tmp_path / "pid").read_text())
    killed.kill()
    killed.wait()
    follower = subprocess.Popen(
        [sys.executable, "-c", hold + "    print('mine', flush=True)"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert follower.stdout is not None
        assert_names(follower.stdout.readline(), "waiting", "another set-up")
        os.kill(installer, signal.SIGKILL)
        assert follower.stdout.readline() == "mine\n"
    finally:
        with suppress(ProcessLookupError):
            os.kill(installer, signal.SIGKILL)
        follower.kill()
        follower.communicate()


def test_a_program_that_fails_is_quoted_and_logged(tmp_path: Path) -> None:
    shell = Shell(os.environ, tmp_path / "log", os.open(tmp_path, os.O_RDONLY))
    with raises_naming(StepError, "sh", "exit code 3") as failed:
        shell.run("sh", "-c", "echo first; echo second >&2; exit 3")
    assert str(failed.value).splitlines()[1:] == ["  | first", "  | second"]
    assert (tmp_path / "log").read_text(encoding="utf-8").endswith("first\nsecond\n")
    with raises_naming(StepError, "no-such-program", "no such file"):
        shell.run("no-such-program")
    os.close(shell.lock)


@pytest.mark.parametrize("how", ["exit 130", "kill -INT $$"])
def test_a_program_that_ctrl_c_ended_counts_as_interrupted_not_as_failed(how: str, tmp_path: Path) -> None:
    shell = Shell(os.environ, tmp_path / "log", os.open(tmp_path, os.O_RDONLY))
    with pytest.raises(KeyboardInterrupt):
        shell.run("sh", "-c", how)
    job = shell.start("sh", "-c", how)
    with pytest.raises(KeyboardInterrupt):
        job.end()
    os.close(shell.lock)


def test_pip_without_a_network_is_told_as_that_and_not_as_a_conflict(tmp_path: Path) -> None:
    nowhere = ("--retries", "1", "--target", tmp_path / "there")
    environ = {**os.environ, "PIP_CONFIG_FILE": os.devnull, "PIP_INDEX_URL": "http://127.0.0.1:9/simple"}
    with (tmp_path / "lock").open("w", encoding="utf-8") as lock:
        shell = Shell(environ, tmp_path / "log", lock.fileno())
        with pytest.raises(StepError) as caught:
            shell.run(sys.executable, "-m", "pip", "install", *nowhere, "no-such-package-anywhere")
    assert_names(str(caught.value), "network", "HTTPS_PROXY")
    assert "\n" not in str(caught.value)
    assert "No matching distribution" in (tmp_path / "log").read_text(encoding="utf-8")


def test_keys_tell_apart_names_contents_and_bounds(tmp_path: Path) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    one.write_text("ab")
    two.write_text("ab")
    keys = [key_of(one), key_of(two), key_of(one, two), key_of("ab"), key_of("a", "b"), key_of(["a", "b"])]
    assert len(set(keys)) == len(keys)
    before = key_of(one)
    one.write_text("abc")
    assert key_of(one) != before
