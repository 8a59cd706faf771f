"""HEAD wherever GET is: the answer that GET would give, without its body."""

from __future__ import annotations

from starlette.routing import Match, Router
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class HeadRequests:
    """Middleware that asks the GET route of a path on HEAD, unless the path has an answer of its own to HEAD.

    `router`: whose routes say what there is
    """

    def __init__(self, app: ASGIApp, router: Router) -> None:
        self.app, self.router = app, router

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] != "HEAD" or self._is_there(scope):
            await self.app(scope, receive, send)
            return
        asked = dict(scope, method="GET")
        if not self._is_there(asked):
            asked["method"] = "HEAD"

        async def head_only(message: Message) -> None:
            await send(message if message["type"] != "http.response.body" else {"type": "http.response.body", "body": b""})
            if message["type"] == "http.response.body":
                # an event stream, too, ends here
                raise _Sent

        try:
            await self.app(asked, receive, head_only)
        except _Sent:
            pass
        finally:
            # what the access log tells of the route
            if "route" in asked:
                scope["route"] = asked["route"]

    def _is_there(self, scope: Scope) -> bool:
        return any(route.matches(dict(scope))[0] is Match.FULL for route in self.router.routes)


class _Sent(Exception):
    """The head has been sent."""
