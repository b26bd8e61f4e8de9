"""What the quality-of-service profiles promise, with real publishers."""

import time

import pytest

pytest.importorskip("rclpy")

from tripod_graph.qos import LATCHED, LATCHED_OF_ALL


@pytest.mark.ros
def test_a_late_subscriber_hears_the_last_word_of_each_operator(domain: int) -> None:
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node
    from std_msgs.msg import String

    context = rclpy.Context()
    context.init(domain_id=domain)
    node = Node("operators", context=context, enable_rosout=False)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    try:
        publishers = [node.create_publisher(String, "words", LATCHED) for _ in range(5)]
        for i, publisher in enumerate(publishers):
            publisher.publish(String(data="an older word"))
            publisher.publish(String(data=f"word {i}"))
        heard: list[str] = []
        subscription = node.create_subscription(
            String, "words", lambda m: heard.append(m.data), LATCHED_OF_ALL
        )
        deadline = time.monotonic() + 20
        while any(p.get_subscription_count() < 1 for p in publishers):
            assert time.monotonic() < deadline, "waited in vain for the subscription"
            time.sleep(0.01)
        time.sleep(0.3)  # a busy subscriber: all the words arrive before it takes the first
        while len(heard) < len(publishers):
            assert time.monotonic() < deadline, f"heard only {heard}"
            executor.spin_once(timeout_sec=0.01)
        assert sorted(heard) == [f"word {i}" for i in range(5)]
        node.destroy_subscription(subscription)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
