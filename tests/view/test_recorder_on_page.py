"""What the page knows of the recorder: from values, however its sentences are worded."""

from tripod_graph.diagnostic_keys import Recording
from tripod_view.recorder import Recorder


def test_the_answer_of_the_recorder_is_taken_by_its_success() -> None:
    recorder = Recorder()
    recorder.answer("no space", begin=True, success=False)
    assert (recorder.records, recorder.text) == (False, "no space")
    recorder.answer("a.mcap", begin=True, success=True)
    assert recorder.records
    recorder.answer("it records already", begin=True, success=False)
    assert recorder.records, "another recording goes on"
    recorder.answer("closed", begin=False, success=True)
    assert not recorder.records


def test_the_state_of_the_recorder_is_taken_by_its_word() -> None:
    recorder = Recorder()
    recorder.hear("3 messages lost", Recording.ON, "a.mcap")
    assert (recorder.records, recorder.text) == (True, "3 messages lost: a.mcap")
    recorder.hear("no space", Recording.ENDED, "a.mcap")
    assert (recorder.records, recorder.text) == (False, "no space: a.mcap")
    recorder.hear("nothing", Recording.OFF, "")
    assert (recorder.records, recorder.text) == (False, "no space: a.mcap")
