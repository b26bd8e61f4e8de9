"""The controls of the page: stop, mode, sliders, status, plots; degrees and millimetres on the screen."""

from collections.abc import Sequence

import numpy as np
import viser
import viser.uplot
from numpy.typing import NDArray

from tripod_graph.command import CommandLimits
from tripod_view.events import Button, Inbox, Pressed, SliderMoved
from tripod_view.history import SPAN
from tripod_view.scene import SERVO_COLOURS
from tripod_view.words import Line, lines_html

FloatArray = NDArray[np.float64]

STEP = 0.5
"""Step of the sliders [degrees]."""

FACTOR_COLOUR = (47, 158, 68)

MODES = {"sliders": Button.TELEOP, "green target": Button.IK}
STYLE = """<style>
button:has(.icon-tabler-hand-stop) { height: 3.2em !important; font-size: 1.3em; letter-spacing: .1em; }
</style>"""
"""The stop button is the largest thing of the panel."""

MOTIONS = {"working pose": Button.WORKING_POSE, "park": Button.PARK}


class Panel:
    """Shows what it is told; every method is called from the thread of ROS only.

    Callbacks of viser are coroutines: they run in order on the web server's thread and only put an event into
    the inbox. What the code itself sets (no client in the event) is not an event.
    """

    def __init__(self, server: viser.ViserServer, inbox: Inbox, limits: CommandLimits) -> None:
        self._gui, self._inbox, self._limits = server.gui, inbox, limits
        self._shown: dict[str, str] = {}
        gui = self._gui
        gui.configure_theme(
            control_layout="floating", control_width="medium", show_logo=False, show_share_button=False
        )
        gui.set_panel_label("Tripod")
        gui.main_panel.dock_right()
        gui.add_html(STYLE)
        stop = gui.add_button(
            "STOP", color="red", icon="hand-stop", hint="All commands off: the servos hold, then park"
        )
        self._on_press(stop, Button.STOP)
        self._mode = gui.add_html("")
        modes = gui.add_button_group("Control by", tuple(MODES))
        self._on_choice(modes, MODES)
        with gui.add_folder("Servo angles"):
            self._sliders = [self._add_slider(i) for i in range(len(SERVO_COLOURS))]
            motions = gui.add_button_group("Go to", tuple(MOTIONS), hint="A slow motion of several seconds")
            self._on_choice(motions, MOTIONS)
            self._notice = gui.add_html("")
        with gui.add_folder("Target"):
            self._target = gui.add_html("")
            fetch = gui.add_button("Bring target to effector", color="gray")
            self._on_press(fetch, Button.FETCH_TARGET)
        with gui.add_folder("Status"):
            self._status = gui.add_html("")
            self._mesh_lines = gui.add_checkbox("Mesh lines", True)
        with gui.add_folder("Plots"):
            names = [f"servo {i}" for i in range(len(self._sliders))]
            low, high = self._sliders[0].min, self._sliders[0].max
            self._angles = self._add_plot("servo angles (°)", names, SERVO_COLOURS, (low, high))
            self._factor = self._add_plot("simulated / real time", ["factor"], [FACTOR_COLOUR], (0.0, 1.5))

    @property
    def mesh_lines(self) -> bool:
        """Whether the user wants to see the lines of the mesh."""
        return bool(self._mesh_lines.value)

    def enable_sliders(self, enabled: bool) -> None:
        """Let the sliders be moved or not."""
        for slider in self._sliders:
            slider.disabled = not enabled

    def show_range(self, limits: CommandLimits) -> None:
        """Let the sliders end where the joints may go."""
        for servo, slider in enumerate(self._sliders):
            low, high = _ends(limits, servo)
            slider.value = float(np.clip(slider.value, low, high))
            slider.min, slider.max = low, high

    def set_sliders(self, angles: FloatArray) -> None:
        """Set the sliders to `angles` [rad], shape (3,)."""
        for slider, angle in zip(self._sliders, angles, strict=True):
            shown = round(np.degrees(float(angle)) / STEP) * STEP
            if slider.value != shown:  # also true for the NaN that a browser may have put there
                slider.value = float(np.clip(shown, slider.min, slider.max))

    def show_mode(self, line: Line) -> None:
        """Show who commands the robot."""
        self._set("mode", self._mode, lines_html([line], rows=2))

    def show_notice(self, lines: Sequence[Line]) -> None:
        """Show what was refused or is under way."""
        self._set("notice", self._notice, lines_html(lines, rows=1))

    def show_target(self, lines: Sequence[Line]) -> None:
        """Show where target and effector are."""
        self._set("target", self._target, lines_html(lines))

    def show_status(self, lines: Sequence[Line]) -> None:
        """Show the states of the other nodes."""
        self._set("status", self._status, lines_html(lines))

    def plot_angles(self, series: Sequence[FloatArray]) -> None:
        """Plot ages [s] and three angles [rad], all of one length."""
        ages, *angles = series
        self._angles.data = (ages, *(np.degrees(a) for a in angles))

    def plot_factor(self, series: Sequence[FloatArray]) -> None:
        """Plot ages [s] and the real-time factor, of one length."""
        self._factor.data = tuple(series)

    def _set(self, key: str, handle: viser.GuiHtmlHandle, html: str) -> None:
        if self._shown.get(key) != html:
            self._shown[key] = handle.content = html

    def _add_slider(self, servo: int) -> viser.GuiSliderHandle[float]:
        low, high = _ends(self._limits, servo)
        slider = self._gui.add_slider(
            f"servo {servo} (°)", low, high, STEP, float(np.clip(0.0, low, high)), disabled=True
        )

        async def on_update(event: viser.GuiEvent[viser.GuiSliderHandle[float]]) -> None:
            if event.client is not None:
                self._inbox.put(SliderMoved(servo, event.target.value))

        slider.on_update(on_update)
        return slider

    def _on_press(self, handle: viser.GuiButtonHandle, button: Button) -> None:
        async def on_click(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                self._inbox.put(Pressed(button))

        handle.on_click(on_click)

    def _on_choice(self, handle: viser.GuiButtonGroupHandle, choices: dict[str, Button]) -> None:
        async def on_click(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
            button = choices.get(str(event.target.value))
            if event.client is not None and button is not None:
                self._inbox.put(Pressed(button))

        handle.on_click(on_click)

    def _add_plot(
        self,
        title: str,
        names: Sequence[str],
        colours: Sequence[tuple[int, int, int]],
        span: tuple[float, float],
    ) -> viser.GuiUplotHandle:
        """Add a plot of the last SPAN seconds, its values within `span`."""
        series = [viser.uplot.Series(label="s")]
        for name, (r, g, b) in zip(names, colours, strict=True):
            series.append(viser.uplot.Series(label=name, stroke=f"rgb({r},{g},{b})", width=2))
        return self._gui.add_uplot(
            tuple(np.zeros(0) for _ in range(1 + len(names))),
            tuple(series),
            title=title,
            scales={
                "x": viser.uplot.Scale(time=False, range=(-SPAN, 0.0)),
                "y": viser.uplot.Scale(range=span),
            },
            legend=viser.uplot.Legend(show=False),
            height=150,
        )


def _ends(limits: CommandLimits, servo: int) -> tuple[float, float]:
    """Return where the slider of `servo` ends [degrees], in whole steps."""
    low, high = np.degrees(limits.lower[servo]), np.degrees(limits.upper[servo])
    return float(np.ceil(low / STEP) * STEP), float(np.floor(high / STEP) * STEP)
