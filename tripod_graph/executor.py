"""What a node waits with: rclpy's single-threaded executor, without what makes that dear at high rates.

For each callback rclpy gathers all that a node has, builds two sets to wait for, and makes a task. Here things are
gathered when one was made or destroyed, all that is ready is done after one wait, by plain calls, and events of the
middleware (a quality of service that does not fit) are looked at once a second. Callbacks of timers, subscriptions and
services have to be functions, not coroutines.
"""

import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.event_handler import EventHandler
from rclpy.exceptions import InvalidHandle
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.task import Task
from rclpy.utilities import timeout_sec_to_nsec
from rclpy.waitable import NumberOfEntities

EVENT_PERIOD = 1.0
"""Between two looks for events [s]."""

MOST = 100
"""Messages that are taken of a subscription before others have their turn."""

Ready = tuple[Callable[[Any], object], Any]
"""What to do, and with what."""


class Patient(MutuallyExclusiveCallbackGroup):
    """Subscriptions that wake nobody: their messages are taken when something else does, before that, or the wait ends.

    Only the order changes, and how late they come. Other executors treat them as all others.
    """


class NodeExecutor(Executor):
    """Runs the callbacks of nodes in the thread that spins it."""

    def __init__(self, *, context: Any = None) -> None:
        self._stale = True
        self._held = ExitStack()
        self._look_next = float("-inf")
        super().__init__(context=context)

    def wake(self) -> None:
        """Wake the executor, because something was made or destroyed, or the context ends."""
        self._stale = True
        super().wake()

    def add_node(self, node: Any) -> bool:
        """Add a node; return whether it was not there."""
        self._stale = True
        return bool(super().add_node(node))

    def remove_node(self, node: Any) -> None:
        """Leave a node to others."""
        self._stale = True
        super().remove_node(node)

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """End; what was held to wait for it is let go."""
        self._held.close()
        return bool(super().shutdown(timeout_sec))

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait until something is ready, at most `timeout_sec` [s], None: for ever; and do all that is."""
        if self._tasks:
            self._go_on_with_tasks()
        if self._stale:
            self._gather()
        if (now := time.monotonic()) >= self._look_next:
            self._look_next = now + EVENT_PERIOD
            self._look_for_events()
        ready = self._wait(timeout_sec_to_nsec(timeout_sec))
        if self._is_shutdown:
            return
        for subscription in self._patient:
            self._take_all(subscription)
            if self._stale:
                break
        for k, (act, entity) in enumerate(ready):
            if (
                self._stale
            ):  # what is left may be gone; else it is ready again, but a guard condition says so only once
                for _, left in ready[k:]:
                    if isinstance(left, GuardCondition):
                        left.trigger()
                return
            act(entity)

    def spin_once_until_future_complete(self, future: Any, timeout_sec: Any = None) -> None:
        """Spin once; the end of `future` ends the wait."""
        future.add_done_callback(lambda _: self.wake())
        if not future.done():
            self.spin_once(getattr(timeout_sec, "timeout", timeout_sec))

    def _go_on_with_tasks(self) -> None:
        """Go on with what rclpy itself does in turns: callbacks of futures."""
        with self._tasks_lock:
            tasks = list(self._tasks)
            self._tasks.clear()
        for task, entity, node in tasks:
            self._go_on(task, entity, node)

    def _go_on(self, task: Task, entity: Any = None, node: Any = None) -> None:
        task()
        if task.done():
            task.result()  # raises what it has raised
        elif not task.cancelled():
            with self._tasks_lock:
                self._tasks.append((task, entity, node))

    def _gather(self) -> None:
        """Hold all that there is to wait for, so that it is not destroyed meanwhile, and make the sets."""
        self._held.close()
        self._stale = False  # first: what is made from here on makes it stale again
        if not self._context.ok():
            raise ExternalShutdownException()
        nodes = self.get_nodes()
        subscriptions = [s for node in nodes for s in node.subscriptions]
        waitables = [w for node in nodes for w in node.waitables]
        guards = [self._guard, self._sigint_gc, *(g for node in nodes for g in node.guards)]
        self._held.enter_context(self._context.handle)
        timers = self._hold(t for node in nodes for t in node.timers)
        urgent = self._hold(s for s in subscriptions if not isinstance(s.callback_group, Patient))
        services = self._hold(s for node in nodes for s in node.services)
        clients = self._hold(c for node in nodes for c in node.clients)
        self._patient = [
            *self._hold(s for s in subscriptions if isinstance(s.callback_group, Patient)).values()
        ]
        self._guards = self._hold(guards)
        self._events = self._enter(w for w in waitables if isinstance(w, EventHandler))
        self._waitables = self._enter(w for w in waitables if not isinstance(w, EventHandler))
        number = NumberOfEntities(len(urgent), len(self._guards), len(timers), len(clients), len(services))
        for waitable in self._waitables:
            number += waitable.get_num_entities()
        self._set, self._event_set = (
            self._wait_set(number),
            self._wait_set(NumberOfEntities(num_events=len(self._events))),
        )
        self._kinds = [
            (kind, act, held)
            for kind, act, held in (
                ("timer", self._call, timers),
                ("subscription", self._take_one, urgent),
                ("service", self._answer, services),
                ("client", self._hear, clients),
            )
            if held
        ]
        self._adds = [
            (getattr(self._set, f"add_{kind}"), entity.handle)
            for kind, held in (*((k, held) for k, _, held in self._kinds), ("guard_condition", self._guards))
            for entity in held.values()
        ]

    def _hold(self, entities: Iterable[Any]) -> dict[int, Any]:
        """Return those that are not being destroyed by their pointers, which stay valid until the next time."""
        held = {}
        for entity in list(entities):
            try:
                self._held.enter_context(entity.handle)
            except InvalidHandle:
                continue
            held[entity.handle.pointer] = entity
        return held

    def _enter(self, waitables: Iterable[Any]) -> list[Any]:
        held = []
        for waitable in list(waitables):
            try:
                self._held.enter_context(waitable)
            except InvalidHandle:
                continue
            held.append(waitable)
        return held

    def _wait_set(self, n: NumberOfEntities) -> Any:
        return rclpy_implementation.WaitSet(
            n.num_subscriptions, n.num_guard_conditions, n.num_timers, n.num_clients, n.num_services, n.num_events,
            self._context.handle,
        )  # fmt: skip

    def _wait(self, nanoseconds: int) -> list[Ready]:
        wait_set = self._set
        wait_set.clear_entities()
        for add, handle in self._adds:
            add(handle)
        for waitable in self._waitables:
            waitable.add_to_wait_set(wait_set)
        wait_set.wait(nanoseconds)
        ready: list[Ready] = []
        for kind, act, held in self._kinds:
            ready += [
                (act, held[p]) for p in wait_set.get_ready_entities(kind) if p in held
            ]  # others are of waitables
        for pointer in wait_set.get_ready_entities("guard_condition"):
            if (guard := self._guards.get(pointer)) is not None and guard.callback is not None:
                ready.append((self._call_guarded, guard))
        ready += [(self._handle, waitable) for waitable in self._waitables if waitable.is_ready(wait_set)]
        return ready

    def _look_for_events(self) -> None:
        if not self._events:
            return
        self._event_set.clear_entities()
        for event in self._events:
            event.add_to_wait_set(self._event_set)
        self._event_set.wait(0)
        for event in self._events:
            if event.is_ready(self._event_set):
                self._handle(event)

    def _call(self, timer: Any) -> None:
        if timer.handle.is_timer_ready():  # not where it was cancelled meanwhile
            timer.handle.call_timer()
            timer.callback()

    def _take_one(self, subscription: Any) -> bool:
        taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        if taken is None:
            return False
        if subscription._callback_type is Subscription.CallbackType.MessageOnly:
            subscription.callback(taken[0])
        else:
            subscription.callback(*taken)
        return True

    def _take_all(self, subscription: Any) -> None:
        for _ in range(min(MOST, subscription.qos_profile.depth)):
            if not self._take_one(subscription) or self._stale:
                return

    def _answer(self, service: Any) -> None:
        request, header = service.handle.service_take_request(service.srv_type.Request)
        if header is not None:
            service.send_response(service.callback(request, service.srv_type.Response()), header)

    def _call_guarded(self, guard: GuardCondition) -> None:
        guard.callback()

    def _hear(self, client: Any) -> None:
        self._start(self._take_client(client))

    def _handle(self, waitable: Any) -> None:
        self._start(self._take_waitable(waitable))

    def _start(self, act: Any) -> None:
        if act is not None:
            self._go_on(Task(act, executor=self))
