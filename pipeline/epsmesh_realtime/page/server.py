"""A server for one page: on the loopback address alone, at an address that cannot be guessed."""

from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from secrets import compare_digest, token_urlsafe

HOST = "127.0.0.1"
_TOKEN = 24
_PATIENCE = 10  # seconds that a request may take to come


class PageServer(ThreadingHTTPServer):
    """Serves ``text`` at ``address``, and at no other; a context manager, ``serve_forever`` serves."""

    daemon_threads = True

    def __init__(self, text: str):
        self.body = text.encode()
        self.path = f"/{token_urlsafe(_TOKEN)}/"
        super().__init__((HOST, 0), _Handler)

    @property
    def address(self) -> str:
        """What a browser is to open."""
        return f"http://{HOST}:{self.server_port}{self.path}"

    @property
    def hosts(self) -> tuple[str, str]:
        """What a browser names as its host: any other name was made to lead here by somebody else."""
        return f"{HOST}:{self.server_port}", f"localhost:{self.server_port}"


class _Handler(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version, timeout = "epsmesh", "", _PATIENCE

    def do_GET(self) -> None:
        """Send the page."""
        is_known = compare_digest(self.path.encode(), self.server.path.encode())
        if not is_known or self.headers.get("Host") not in self.server.hosts:
            self.send_error(HTTPStatus.NOT_FOUND)
            return
        self.send_response(HTTPStatus.OK)
        headers = {
            "Content-Type": "text/html; charset=utf-8",
            "Content-Length": str(len(self.server.body)),
            "Cache-Control": "no-store",
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
        }
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(self.server.body)

    def log_message(self, format: str, *_: object) -> None:
        """Say nothing: the address would be in it."""
