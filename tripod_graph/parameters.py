"""Parameters of a node as one table, from which they are declared, checked and printed."""

import math
from collections.abc import Callable, Mapping, Sequence
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any, Final

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

SHARED: Final[ContextVar[frozenset[str]]] = ContextVar("SHARED", default=frozenset())
"""Names in blocks of parameter files that are for several nodes: who does not know one leaves it alone."""

Adopt = Callable[[Mapping[str, Any]], None]
"""Takes the values of a node's whole table, some of them new; raises ValueError to refuse these, changing nothing."""


class ParameterError(ValueError):
    """A value that is refused; the message names the parameter, the value and what is allowed."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of a node.

    Attributes:
        name: As in `NAME:=VALUE`.
        default: Its value unless set; the type of it is the type of the parameter. An empty list is one of
            numbers.
        help: What it does, one line.
        unit: SI unit, empty if none.
        low: Smallest value allowed.
        high: Largest value allowed.
        choices: The values allowed, where they are a closed set.
        dynamic: Whether it may change while the node runs; else it is set once, when the node starts.
    """

    name: str
    default: bool | int | float | str | list[float]
    help: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    dynamic: bool = False

    @property
    def note(self) -> str:
        """When it may change, to be put behind what is said of it."""
        return "; may change while the node runs" if self.dynamic else ""

    @property
    def allowed(self) -> str:
        """What is allowed, for messages and help."""
        if self.choices:
            return "one of " + ", ".join(self.choices)
        unit = f" {self.unit}" if self.unit else ""
        if self.low is not None and self.high is not None:
            return f"{self.low:g} to {self.high:g}{unit}"
        if self.low is not None:
            return f"at least {self.low:g}{unit}"
        return f"at most {self.high:g}{unit}" if self.high is not None else ""

    def taken(self, value: Any) -> Any:
        """Return a value that was given as this parameter takes it: integers for floats as the floats that they are.

        Raises:
            ParameterError: it is of another type, or not allowed.
        """
        found = _as_float(value, self.default)
        try:
            fits = _type(found) is _type(self.default)
        except TypeError:  # ROS has no such parameters
            fits = False
        if not fits:
            wanted = "list of numbers" if isinstance(self.default, list) else type(self.default).__name__
            raise ParameterError(f"parameter '{self.name}' is {value!r}; it must be of type {wanted}")
        self.check(found)
        return found

    def check(self, value: Any) -> None:
        """Raise ParameterError unless `value` is within the range or the choices."""
        values = value if isinstance(value, list | tuple) else [value]
        for v in values:
            number = isinstance(v, int | float) and not isinstance(v, bool)
            nan = isinstance(v, float) and math.isnan(v)
            low_ok = self.low is None or (number and v >= self.low)
            high_ok = self.high is None or (number and v <= self.high)
            if nan or not (low_ok and high_ok) or (self.choices and v not in self.choices):
                allowed = self.allowed or "any number"
                raise ParameterError(f"parameter '{self.name}' is {value!r}; allowed: {allowed}")


def declare(node: Node, table: Sequence[Parameter], adopt: Adopt | None = None) -> dict[str, Any]:
    """Declare every parameter of `table` and return their values by name.

    Integers given for floats are taken as the floats that they are. `adopt`: for tables with dynamic parameters; ROS
    refuses a change of any other.

    Raises:
        ParameterError: a value is not allowed, or a name unknown. What `qos_overrides` would set is fixed: the nodes
            rely on it.
    """
    overrides = node._parameter_overrides  # rclpy offers no other way to list what was set
    names = {p.name for p in table}
    known = names | {"use_sim_time", "start_type_description_service"} | SHARED.get()
    for name in overrides:
        if name in known:
            continue
        if name.startswith("qos_overrides."):
            raise ParameterError(
                f"parameter '{name}' is refused: the quality of service of topics cannot be changed"
            )
        all_names = ", ".join(sorted(names)) or "none"
        raise ParameterError(f"parameter '{name}' is unknown; parameters: {all_names}")
    values: dict[str, Any] = {}
    for p in table:
        kind = _type(p.default)
        given = overrides.get(p.name)
        value = p.taken(p.default if given is None else given.value)
        if value == []:  # which rclpy takes for bytes, unless it is set with its type
            overrides.pop(p.name, None)
            node.declare_parameter(p.name, kind)
            node.set_parameters([RosParameter(p.name, kind, value)])
            node.set_descriptor(p.name, descriptor(p))
        else:
            overrides[p.name] = RosParameter(p.name, kind, value)
            node.declare_parameter(p.name, kind, descriptor(p))
        values[p.name] = value
    if adopt is not None:
        node.add_on_set_parameters_callback(_taker({p.name: p for p in table}, dict(values), adopt))
    return values


def _taker(
    table: Mapping[str, Parameter], values: dict[str, Any], adopt: Adopt
) -> Callable[[list[RosParameter]], SetParametersResult]:
    """Return what ROS asks about changes, after it has looked at types, ranges and what is read-only."""

    def take(changes: list[RosParameter]) -> SetParametersResult:
        new = {c.name: c.value for c in changes if c.name in table}
        new = {name: list(v) if isinstance(table[name].default, list) else v for name, v in new.items()}
        try:
            for name, value in new.items():
                table[name].check(value)
            if new:
                adopt({**values, **new})
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        values.update(new)
        return SetParametersResult(successful=True)

    return take


def descriptor(p: Parameter) -> ParameterDescriptor:
    """Return what ROS tools show of a parameter and check: meaning, unit, range."""
    text = f"{p.help} [{p.unit}]" if p.unit else p.help
    kind = _type(p.default).value
    told = ParameterDescriptor(
        description=text, type=kind, additional_constraints=p.allowed, read_only=not p.dynamic
    )
    if p.low is None and p.high is None:
        return told
    if type(p.default) is int:
        least, most = -(2**63) if p.low is None else int(p.low), 2**63 - 1 if p.high is None else int(p.high)
        told.integer_range = [IntegerRange(from_value=least, to_value=most)]
    elif isinstance(p.default, float):
        low, high = -math.inf if p.low is None else p.low, math.inf if p.high is None else p.high
        told.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    return told


def _type(value: Any) -> RosParameter.Type:
    """Return the type of ROS for `value`, which is one of numbers if it is an empty list."""
    numbers = isinstance(value, list) and all(isinstance(v, float) for v in value)
    return RosParameter.Type.DOUBLE_ARRAY if numbers else RosParameter.Type.from_parameter_value(value)


def _as_float(value: Any, default: object) -> Any:
    """Return integers as floats where `default` is a float or a list of floats; anything else as it is.

    An empty list arrives as None: YAML does not tell what would have been in it.
    """
    if isinstance(default, float) and type(value) is int:
        return float(value)
    if isinstance(default, list) and value is None:
        return []
    if isinstance(default, list) and not isinstance(value, str | bytes) and hasattr(value, "__len__"):
        return [float(v) if type(v) is int else v for v in value]
    return value
