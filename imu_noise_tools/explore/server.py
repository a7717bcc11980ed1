# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The address of the page: this machine alone, below a path that nobody guesses.

Everything, the websocket too, lies below ``/<token>/``; what asks for anything else is refused.
The page may load nothing from elsewhere: the browser is told so, and keeps to it.

"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import nullcontext
import secrets
import signal
import socket
from typing import Any
import webbrowser

from .session import Session
from ..core.errors import InputError

HOST = '127.0.0.1'
MISSING = InputError('the page needs what is not installed',
                     'pip install "imu_noise_tools[explore]"')
# Vue builds its templates in the browser, hence unsafe-eval; everything comes from here
_POLICY = ("default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
           "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
           "connect-src 'self' ws://127.0.0.1:* ws://localhost:*; frame-ancestors 'none'; "
           "base-uri 'none'; form-action 'none'")
_HEADERS = ((b'content-security-policy', _POLICY.encode()), (b'referrer-policy', b'no-referrer'),
            (b'x-content-type-options', b'nosniff'))


class Guard:
    """Lets pass only what knows the token, and says to the browser what a page may load."""

    def __init__(self, app: Any, token: str) -> None:
        self.app, self._token = app, token

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer one request, or hand it on."""
        if scope['type'] == 'lifespan':
            await self.app(scope, receive, send)
            return
        first = scope['path'].lstrip('/').partition('/')[0]
        if not secrets.compare_digest(first.encode(), self._token.encode()):
            await _refuse(scope, receive, send)
            return

        async def with_policy(message: Any) -> None:
            if message['type'] == 'http.response.start':
                message = {**message, 'headers': [*message.get('headers', ()), *_HEADERS]}
            await send(message)
        await self.app(scope, receive, with_policy)


async def _refuse(scope: Any, receive: Any, send: Any) -> None:
    if scope['type'] == 'websocket':
        await receive()
        await send({'type': 'websocket.close', 'code': 1008})
        return
    await send({'type': 'http.response.start', 'status': 403,
                'headers': [(b'content-type', b'text/plain; charset=utf-8')]})
    await send({'type': 'http.response.body',
                'body': b'Refused: open the address that imu_noise explore printed.\n'})


def listening(port: int) -> socket.socket:
    """Return a socket of this machine alone; raise InputError where the port is taken."""
    found = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind((HOST, port))
    except (OSError, OverflowError) as error:
        found.close()
        why = getattr(error, 'strerror', None) or str(error)
        raise InputError(f'port {port} cannot be had ({why})',
                         'choose another with --port, or leave it out') from None
    found.listen(64)
    return found


def serve(session: Session | None, port: int = 0, browser: bool = True,
          say: Callable[[str], None] = print, live: Any = None) -> None:
    """
    Serve the page of a session until Ctrl-C or SIGTERM.

    Parameters
    ----------
    session : Session or None
        Begun here, and closed in the end.
    port : int
        0 for any that is free.
    browser : bool
        Whether to open one.
    say : callable
        Is told the address.
    live : Follower or None
        What follows the topics of a running analyser, in place of a session; closed in the end.

    Raises
    ------
    InputError
        The port is taken, or the framework of the page is not installed.

    """
    try:
        from fastapi import FastAPI
        from nicegui import ui
        import uvicorn
    except ImportError:
        raise MISSING from None
    from .page import build

    token = secrets.token_urlsafe(24)
    found = listening(port)
    url = f'http://{HOST}:{found.getsockname()[1]}/{token}/'
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    build(session, live)
    ui.run_with(app, title='imu_noise explore', mount_path=f'/{token}', dark=None,
                tailwind=False, show_welcome_message=False, reconnect_timeout=10.0)
    server = uvicorn.Server(uvicorn.Config(
        Guard(app, token), log_level='error', access_log=False, ws_max_size=1 << 20,
        timeout_graceful_shutdown=1))
    if session is not None:
        session.begin()
    say(url)
    if browser:
        webbrowser.open(url)
    try:
        asyncio.run(_run(server, found, (session or live).stop))
    finally:
        (session or live).close()
        found.close()


async def _run(server: Any, found: socket.socket, ended: Callable[[], None]) -> None:
    """Run a server until a signal: that is how it is meant to end, no failure."""
    loop = asyncio.get_running_loop()

    def stop() -> None:
        server.should_exit = True
        ended()         # threads that wait for what is under way would hold the process

    server.capture_signals = nullcontext     # its own would raise them again in the end
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop)
    await server.serve(sockets=[found])
