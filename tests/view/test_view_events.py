"""The hand-over from the threads of the page: order, bounds, and one wake-up a batch."""

import math
import threading

import numpy as np
import pytest

from tripod_view.events import (
    Button,
    Dragged,
    Dropped,
    EventError,
    Grabbed,
    Inbox,
    Joined,
    JointMoved,
    KeysHeld,
    Left,
    Pressed,
    Pull,
    Replayed,
    Reset,
    SlideMoved,
    SliderMoved,
    Wish,
    event_of,
)


def test_events_keep_their_order_and_wake_the_reader_once_a_batch() -> None:
    wakes = []
    inbox = Inbox(lambda: wakes.append(1))
    sent = [Joined(1), Grabbed(1), Dragged(1, (0, 0, 0)), Dropped(1), Pressed(Button.IK), Left(1)]
    for event in sent:
        inbox.put(event)
    assert len(wakes) == 1
    assert inbox.drain() == sent
    assert inbox.drain() == []
    inbox.put(Joined(2))
    assert len(wakes) == 2


def test_of_a_stream_only_the_newest_is_kept() -> None:
    inbox = Inbox(lambda: None)
    for x in range(100):
        inbox.put(Dragged(1, np.array([x, 0.0, 0.0])))
    inbox.put(Dragged(2, np.zeros(3)))
    for degrees in range(100):
        inbox.put(SliderMoved(0, degrees))
    inbox.put(SliderMoved(1, 5.0))
    inbox.put(Pressed(Button.STOP))
    inbox.put(Pressed(Button.STOP))
    first, second, *rest = inbox.drain()
    assert (first.client, first.position[0], second.client) == (1, 99, 2)
    assert rest == [SliderMoved(0, 99), SliderMoved(1, 5.0), Pressed(Button.STOP)]


def test_a_flood_is_counted_and_never_drowns_stop_or_a_leaving_browser() -> None:
    inbox = Inbox(lambda: None, capacity=10)
    for i in range(100):
        inbox.put(Grabbed(i))
    inbox.put(Pressed(Button.STOP))
    inbox.put(Left(1))
    events = inbox.drain()
    assert (len(events), inbox.lost) == (12, 90)
    assert events[-2:] == [Pressed(Button.STOP), Left(1)]


def test_nothing_is_lost_between_threads() -> None:
    total, seen, enough = 4000, [], threading.Event()
    woken = threading.Semaphore(0)
    inbox = Inbox(woken.release, capacity=10**6)

    def read() -> None:
        while len(seen) < total:
            woken.acquire()
            seen.extend(inbox.drain())
        enough.set()

    threading.Thread(target=read, daemon=True).start()
    writers = [
        threading.Thread(target=lambda k=k: [inbox.put(Joined(k * 1000 + i)) for i in range(1000)])
        for k in range(4)
    ]
    for writer in writers:
        writer.start()
    assert enough.wait(60)
    for k in range(4):
        own = [e.client for e in seen if e.client // 1000 == k]
        assert own == list(range(k * 1000, k * 1000 + 1000))


@pytest.mark.parametrize(
    ("sent", "event"),
    [
        ('{"press": "STOP"}', Pressed(Button.STOP)),
        ('{"servo": 1, "degrees": -90}', SliderMoved(1, -math.pi / 2)),
        ('{"slide": 35}', SlideMoved(0.035)),
        ('{"keys": [0, 1, -1]}', KeysHeld((0, 1, -1))),
        ('{"sim": "reset"}', Reset('{"do": "reset"}')),
        ('{"effect": "sleep", "on": true}', Wish('{"effect": "sleep", "on": true}')),
        ('{"accuracy": "5%"}', Wish('{"accuracy": "5%"}')),
        (
            '{"pull": {"who": 7, "vertex": 3, "from": [0, 0, 1], "to": [1, 2, 3], "stiffness": null}}',
            Pull('{"pull": {"who": 7, "vertex": 3, "from": [0.0, 0.0, 1.0], "to": [1.0, 2.0, 3.0]}}', 7),
        ),
        ('{"let_go": 7}', Wish('{"let_go": 7}')),
        (
            '{"load": {"vertex": 3, "force": [0, 0, 1]}}',
            Wish('{"load": {"vertex": 3, "force": [0.0, 0.0, 1.0]}}'),
        ),
        ('{"speed": 0.5}', Wish('{"speed": 0.5}')),
        ('{"sim": "unload"}', Wish('{"do": "unload"}')),
        ('{"replay": 3, "running": true}', Replayed(3.0, True)),
        ('{"replay": null}', Replayed(None)),
    ],
)
def test_messages_of_the_page_are_events(sent: str, event: object) -> None:
    assert event_of(sent) == event


@pytest.mark.parametrize(
    "sent",
    [
        "", "[]", "null", "{", '{"press": "explode"}', '{"press": 1}', '{"servo": 64, "degrees": 1}',
        '{"servo": true, "degrees": 1}', '{"servo": 0, "degrees": NaN}', '{"servo": 0, "degrees": 1e400}',
        '{"servo": 0, "degrees": "1"}', '{"servo": 0, "degrees": true}', '{"slide": null}', '{"keys": [0, 2, 0]}',
        '{"keys": [0, 1' + ', 0' * 64 + ']}', '{"keys": [true, 0, 0]}',
        '{"pull": {"who": 7, "vertex": 3, "from": [0, 0, 0], "to": [1, 2, NaN], "stiffness": null}}', '{"let_go": -1}',
        '{"pull": {"who": true, "vertex": 3, "from": [0, 0, 0], "to": [1, 2, 3], "stiffness": 1}}', '{"speed": "1"}',
        '{"pull": {"who": 7, "vertex": 3, "from": [0, 0, 0], "to": [1, 2], "stiffness": 1}}',
        '{"load": {"vertex": 3, "force": 1}}',
        '{"sim": "figures"}', '{"effect": "sleep", "on": 1}',
        '{"replay": "now", "running": true}', '{"replay": 1}', "[" * 500, b"\xff".decode("latin-1"),
    ],
)  # fmt: skip
def test_what_no_page_sends_is_refused(sent: str) -> None:
    with pytest.raises(EventError):
        event_of(sent)


def test_a_joint_that_is_no_servo_is_moved_in_the_unit_of_its_slider() -> None:
    assert event_of('{"joint": 1, "value": 12.5}') == JointMoved(1, 12.5)
    for wrong in ('{"joint": 1, "value": NaN}', '{"joint": -1, "value": 1}', '{"joint": true, "value": 1}'):
        with pytest.raises(EventError):
            event_of(wrong)
    inbox = Inbox(lambda: None)
    for event in (JointMoved(0, 1.0), JointMoved(0, 2.0), JointMoved(1, 3.0)):
        inbox.put(event)
    assert inbox.drain() == [JointMoved(0, 2.0), JointMoved(1, 3.0)]
