"""How a run shows itself in a notebook."""

from __future__ import annotations

import contextlib
import html
import time as clock
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Optional
from urllib.parse import urlsplit, urlunsplit

import numpy as np

from ._waiting import moment_after
from .errors import TomboloError

if TYPE_CHECKING:
    from .run import Run

__all__ = ["Plot", "summary", "viewer"]

#: Size of a plot and its margins, in pixels; the most points that its line is drawn with.
_WIDTH, _HEIGHT, _LEFT, _REST = 640, 220, 76, 28
_POINTS = 2000
#: Height of the viewer in a frame, in pixels.
_FRAME = 720
#: The names of this machine.
_LOOPBACK = ("localhost", "127.0.0.1", "::1")
#: Seconds between two drawings of a plot that lives.
_PAUSE = 0.5
#: How long a monitor that nobody knows may take to be announced, in seconds.
_ANNOUNCED = 2.0
#: Columns of a monitor's table that are no monitors.
_STEP = ("cycle", "time")


def viewer(link: str, pages: Sequence[str] = ()) -> str:
    """The viewer of a run as HTML: in a frame, and as a link that opens it in a new tab.

    There is a frame where the run says that pages of a notebook's address may show the viewer inside of them
    (``stream.embed``), and a link alone where it names none: no browser would show it then.

    Parameters
    ----------
    link : str
        The run's link. It is in the HTML, though not in the text that is seen, and with it in the notebook's file:
        whoever reads that can do what the link is for while the run goes on.
    pages : sequence of str
        The addresses that the run names, such as ``http://localhost:8888``. Where the link leads to this machine
        the frame has the name that the first of them gives it (``localhost``, ``127.0.0.1``): a browser that shows the
        notebook under another name than the viewer keeps the viewer's cookie back.

    Returns
    -------
    str
        The HTML. Of a run that listens on a socket at a path it is a sentence that says so.

    Examples
    --------
    >>> from tombolo.jupyter import viewer
    >>> print(viewer("http://127.0.0.1:7070/?token=a"))
    <a href="http://127.0.0.1:7070/?token=a" target="_blank" rel="noopener noreferrer">Open the viewer in a new tab</a>
    >>> print(viewer("http://127.0.0.1:7070/?token=a", ["http://localhost:8888"]).split(">")[0] + ">")
    <iframe src="http://localhost:7070/?token=a" width="100%" height="720" allow="fullscreen; clipboard-write">
    """
    if not link.startswith(("http://", "https://")):
        return "The run listens on a socket at a path, which no browser opens."
    framed = _framed(link, pages)
    frame = ""
    if framed is not None:
        source = html.escape(framed, quote=True)
        frame = f'<iframe src="{source}" width="100%" height="{_FRAME}" allow="fullscreen; clipboard-write"></iframe>'
    address = html.escape(link, quote=True)
    return f'{frame}<a href="{address}" target="_blank" rel="noopener noreferrer">Open the viewer in a new tab</a>'


def _framed(link: str, pages: Sequence[str]) -> Optional[str]:
    """The address of the viewer in a frame of the first of some pages that a browser shows it in; None for none."""
    parts = urlsplit(link)
    for page in pages:
        of_page = urlsplit(page)
        # A page that is encrypted has no frame that is not, and the other way round no cookie.
        if of_page.scheme != parts.scheme or of_page.hostname is None or parts.hostname is None:
            continue
        are_here = [hostname in _LOOPBACK for hostname in (of_page.hostname, parts.hostname)]
        if all(are_here):
            place = of_page.netloc.rsplit(":", 1)[0] if of_page.port is not None else of_page.netloc
            port = "" if parts.port is None else f":{parts.port}"
            return urlunsplit(parts._replace(netloc=f"{place}{port}"))
        if not any(are_here):
            return link
    return None


def summary(run: Run) -> str:
    """How far a run is, the newest values of its monitors, and its viewer, as HTML.

    It is what a notebook shows of a `Run`. It does not wait, and does not change any more: `Plot.live` does.

    Parameters
    ----------
    run : Run
        The run.

    Returns
    -------
    str
        The HTML.
    """
    status, end = run._state.status, run.end
    rows = [("run", run.link.split("?")[0]), ("state", _state(run))]
    if end is not None:
        rows += [("cycle", f"{end['cycle']}"), ("time", f"{end['time']:.6g}")]
    elif status is not None:
        rows += [("cycle", f"{status.cycle}"), ("time", f"{status.time:.6g}")]
    for pipeline, table in run.monitors.items():
        last = table.last
        shown = [name if name not in last else f"{name} {last[name]:.6g}" for name in table if name not in _STEP]
        rows.append((pipeline, ", ".join(shown)))
    cells = "".join(
        f'<tr><th style="text-align: left">{html.escape(name)}</th>'
        f'<td style="text-align: left">{html.escape(text)}</td></tr>'
        for name, text in rows
    )
    pages = run._state.hello.get("embed", ()) if run.connected and end is None else ()
    return f"<table>{cells}</table>{viewer(run.link, pages)}"


def _state(run: Run) -> str:
    status = run._state.status
    if run.end is not None:
        return str(run.end["how"])
    if not run.connected:
        return "not connected"
    if run.reconnecting:
        return "connecting again"
    if status is None:
        return "before its first step"
    running = "stopping" if status.stopped else "paused" if status.paused else "running"
    return f"{running}, steered from here" if run.drives else running


class Plot:
    """A monitor over the cycles, as a picture (SVG) that a notebook shows, and that grows while the run goes on.

    Parameters
    ----------
    run : Run
        The run.
    pipeline, monitor : str
        The monitor.

    Examples
    --------
    ::

        import tombolo.jupyter

        tombolo.jupyter.Plot(run, "outlet", "flow")           # as it is now
        tombolo.jupyter.Plot(run, "outlet", "flow").live()    # until the run ends, or the cell is interrupted
    """

    def __init__(self, run: Run, pipeline: str, monitor: str) -> None:
        self.run = run
        self.pipeline = pipeline
        self.monitor = monitor

    def _repr_svg_(self) -> str:
        table = self.run.monitors[self.pipeline]
        values = table[self.monitor]
        cycles = table["cycle"][: len(values)]
        title = html.escape(f"{self.pipeline}: {self.monitor}")
        return _svg(title, np.asarray(cycles), np.asarray(values[: len(cycles)]))

    def live(self, timeout: Optional[float] = None) -> None:
        """Show the plot, and draw it anew about twice a second until the run ends.

        Parameters
        ----------
        timeout : float, optional
            Seconds, at most. The cell can be interrupted, too.

        Raises
        ------
        KeyError
            There is no such monitor.
        """
        from IPython.display import display

        until = moment_after(timeout)
        # One of a pipeline that was added a moment ago is announced a moment later.
        with contextlib.suppress(TomboloError):
            self.run.wait_for(lambda: self.monitor in self.run.monitors.get(self.pipeline, ()), _ANNOUNCED)
        self._repr_svg_()
        handle: Any = display(self, display_id=True)
        while self.run.connected and clock.monotonic() < until:
            clock.sleep(_PAUSE)
            handle.update(self)

    def __repr__(self) -> str:
        return f"<tombolo.jupyter.Plot of {self.pipeline}: {self.monitor}>"


def _svg(title: str, cycles: Any, values: Any) -> str:
    """A line with its bounds, parted where nothing could be measured."""
    every = max(1, -(-len(values) // _POINTS))
    cycles, values = cycles[::every], values[::every]
    known = np.isfinite(values)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" width="{_WIDTH}" '
        f'font-family="sans-serif" font-size="12"><text x="{_LEFT}" y="18">{title}</text>'
    ]
    if known.any():
        least, most = float(values[known].min()), float(values[known].max())
        first, last = float(cycles[0]), float(cycles[-1])
        across = _LEFT + (cycles - first) / max(last - first, 1) * (_WIDTH - _LEFT - _REST)
        down = _HEIGHT - _REST - (values - least) / ((most - least) or 1) * (_HEIGHT - 2 * _REST)
        for piece in np.split(np.arange(len(values)), np.flatnonzero(~known)):
            line = " ".join(f"{across[at]:.1f},{down[at]:.1f}" for at in piece if known[at])
            if line:
                parts.append(f'<polyline fill="none" stroke="#1f6feb" stroke-width="1.5" points="{line}"/>')
        for text, y in ((f"{most:.6g}", _REST + 4), (f"{least:.6g}", _HEIGHT - _REST + 4)):
            parts.append(f'<text x="{_LEFT - 6}" y="{y}" text-anchor="end">{text}</text>')
        parts.append(f'<text x="{_LEFT}" y="{_HEIGHT - 8}">cycle {first:.0f}</text>')
        parts.append(f'<text x="{_WIDTH - _REST}" y="{_HEIGHT - 8}" text-anchor="end">{last:.0f}</text>')
    else:
        parts.append(f'<text x="{_LEFT}" y="{_HEIGHT / 2}">nothing measured yet</text>')
    return "".join(parts) + "</svg>"
