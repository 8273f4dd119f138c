"""A page in a browser on the same machine: people, camera, belief and target, as they are now."""

import json
from collections.abc import Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from string import Template
from threading import Condition, Thread
from typing import Any

from ehar.camera import Camera
from ehar.data.skeleton import Skeleton
from ehar.errors import UsageError
from ehar.world import World
from eval.live.loop import Said
from eval.render.palette import DARK, LIGHT

HOST = "127.0.0.1"  # nobody else may look
PERIOD = 0.1  # [s] between two pictures
KEEP_ALIVE = 5.0  # [s]; a browser that has gone is noticed so soon
ASSETS = files("eval.live") / "assets"


class Page:
    """Serves the page, and tells it ten times a second what goes out (server-sent events).

    Args:
        port: port on 127.0.0.1; 0 takes one that is free.
        class_names: names of what is recognised.
        skeleton: the recogniser's skeleton.
        world: where the camera may be.

    Raises:
        UsageError: the port is taken.
    """

    def __init__(self, port: int, *, class_names: tuple[str, ...], skeleton: Skeleton, world: World) -> None:
        """Begin to serve."""
        self._changed = Condition()
        self._number, self._said, self._open = 0, "", True
        self._html = page_html(class_names, skeleton, world).encode()
        page = self

        class Handler(BaseHTTPRequestHandler):
            """Answers for the page."""

            def do_GET(self) -> None:
                page._answer(self)

            def log_message(self, *_: Any) -> None:
                """Say nothing: standard error is for what matters."""

        try:
            self._server = ThreadingHTTPServer((HOST, port), Handler)
        except (OSError, OverflowError) as error:
            raise UsageError(f"--page {port}: expected a port that is free: {error}") from error
        self._server.daemon_threads = True
        self._thread = Thread(target=self._server.serve_forever, name="ehar live: page", daemon=True)
        self._thread.start()
        self._shown_at = -PERIOD

    @property
    def address(self) -> str:
        """The address for a browser."""
        return f"http://{HOST}:{self._server.server_port}/"

    def show(self, said: Said, now: float) -> None:
        """Show what goes out at a time [s], unless a picture has just been shown."""
        if now - self._shown_at < PERIOD:
            return
        self._shown_at = now
        held = json.loads(said.line())
        joints = None if said.answer is None else said.answer.joints
        held["people"] = [] if joints is None else joints.round(2).tolist()
        with self._changed:
            self._said = json.dumps(held, separators=(",", ":"))
            self._number += 1
            self._changed.notify_all()

    def close(self) -> None:
        """Serve no more."""
        with self._changed:
            self._open = False
            self._changed.notify_all()
        self._server.shutdown()
        self._server.server_close()

    def _answer(self, request: BaseHTTPRequestHandler) -> None:
        if request.path == "/":
            self._begin(request, "text/html; charset=utf-8", {"Content-Length": str(len(self._html))})
            request.wfile.write(self._html)
        elif request.path == "/events":
            self._begin(request, "text/event-stream", {"Cache-Control": "no-store"})
            self._tell(request)
        else:
            request.send_error(HTTPStatus.NOT_FOUND)

    def _begin(self, request: BaseHTTPRequestHandler, kind: str, headers: Mapping[str, str]) -> None:
        request.send_response(HTTPStatus.OK)
        for name, value in {"Content-Type": kind, **headers}.items():
            request.send_header(name, value)
        request.end_headers()

    def _tell(self, request: BaseHTTPRequestHandler) -> None:
        """Write what is shown whenever it changes, until the browser has gone."""
        told = 0
        try:
            while self._open:
                with self._changed:
                    if self._number == told:
                        self._changed.wait(KEEP_ALIVE)
                    event = f"data: {self._said}\n\n" if self._number > told else ": still here\n\n"
                    told = self._number
                request.wfile.write(event.encode())
                request.wfile.flush()
        except OSError:
            return


def page_html(class_names: tuple[str, ...], skeleton: Skeleton, world: World) -> str:
    """Return the page, which asks for nothing but its events."""
    camera: Camera = world.camera
    told = {
        "classes": class_names,
        "bones": skeleton.bones,
        "image": [camera.width, camera.height],
        "distances": [world.workspace.distance_min, world.workspace.distance_max],
    }
    script = json.dumps(told).replace("<", "\\u003c")
    return Template((ASSETS / "page.html").read_text(encoding="utf-8")).substitute(
        told=script, light=LIGHT.css(), dark=DARK.css()
    )
