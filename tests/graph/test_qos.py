"""What the quality-of-service profiles promise, with real publishers."""

import pytest

pytest.importorskip("rclpy")

from tests.graph.bench import Bench
from tripod_graph.qos import LATCHED, LATCHED_OF_ALL


@pytest.mark.ros
def test_a_late_subscriber_hears_the_last_word_of_each_operator(domain: int) -> None:
    from rclpy.node import Node
    from std_msgs.msg import String

    bench = Bench(domain)
    speaker = bench.add(Node("operators", context=bench.context, enable_rosout=False))
    busy = Node("busy", context=bench.context, enable_rosout=False)
    publishers = [speaker.create_publisher(String, "words", LATCHED) for _ in range(5)]
    words = [f"word {i}" for i in range(5)]
    try:
        for word, publisher in zip(words, publishers, strict=True):
            publisher.publish(String(data="an older word"))
            publisher.publish(String(data=word))
        heard, witnessed = list[str](), list[str]()
        busy.create_subscription(String, "words", lambda m: heard.append(m.data), LATCHED_OF_ALL)
        bench.wait(lambda: all(p.get_subscription_count() == 1 for p in publishers), "the subscription")
        speaker.create_subscription(String, "words", lambda m: witnessed.append(m.data), LATCHED_OF_ALL)
        bench.wait(lambda: len(witnessed) == len(words), f"more than {witnessed}")
        assert heard == []  # it is busy: all the words arrive before it takes the first
        bench.add(busy)
        bench.wait(lambda: len(heard) >= len(words), f"more than {heard}")
        assert sorted(heard) == words
    finally:
        bench.close()
