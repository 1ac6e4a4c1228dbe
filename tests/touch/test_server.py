"""The page's server: one page, at one address, for this machine alone, whatever it is asked."""

import socket
import threading

import pytest

from epsmesh_realtime.page.server import HOST, PageServer

TEXT = "<canvas></canvas>"


@pytest.fixture(scope="module")
def server():
    with PageServer(TEXT) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        yield running
        running.shutdown()
        thread.join()


def answer(server, request: str) -> str:
    """Return all that comes back for the bytes of a request, sent as they are."""
    with socket.create_connection((HOST, server.server_port), timeout=10) as connection:
        connection.sendall(request.replace("\n", "\r\n").encode("latin-1") + b"\r\n\r\n")
        connection.shutdown(socket.SHUT_WR)
        return b"".join(iter(lambda: connection.recv(65536), b"")).decode("latin-1")


def test_it_listens_on_the_loopback_address_alone(server):
    assert server.socket.getsockname()[0] == "127.0.0.1"
    with pytest.raises(OSError), socket.create_connection(("::1", server.server_port), timeout=2):
        pass


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_it_answers_by_its_own_names(server, name):
    found = answer(server, f"GET {server.path} HTTP/1.1\nHost: {name}:{server.server_port}\nConnection: close")
    head, _, body = found.partition("\r\n\r\n")
    assert " 200 " in head.splitlines()[0]
    assert body == TEXT
    assert "access-control" not in head.lower()  # no other page may read it


@pytest.mark.parametrize(
    "request_",
    [
        "GET {path} HTTP/1.1\nHost: evil.example",  # a name that was made to lead here
        "GET {path} HTTP/1.1\nHost: evil.example:{port}",
        "GET {path} HTTP/1.1\nHost: 127.0.0.1.evil.example:{port}",
        "GET {path} HTTP/1.1\nHost: 127.0.0.1",
        "GET {path} HTTP/1.1",
        "GET {path} HTTP/1.0",
        "GET {path}",
        "GET http://127.0.0.1:{port}{path} HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET {path}?a=b HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET {path}../ HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET {path}%2e%2e/%2e%2e/etc/passwd HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET /../../../../etc/passwd HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET /etc/passwd HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET / HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET /\xe9\xff\x00/ HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET {swapped} HTTP/1.1\nHost: 127.0.0.1:{port}",
        *(
            f"{method} {{path}} HTTP/1.1\nHost: 127.0.0.1:{{port}}\nContent-Length: 0"
            for method in ("POST", "PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "TRACE", "CONNECT", "BREW")
        ),
        "<script>alert(1)</script> {path} HTTP/1.1\nHost: 127.0.0.1:{port}",
        "nonsense",
        "GET {path} HTTP/9.9\nHost: 127.0.0.1:{port}",
        "GET " + "/" * 70_000 + " HTTP/1.1\nHost: 127.0.0.1:{port}",
        "GET {path} HTTP/1.1\n" + "\n".join(f"A{n}: b" for n in range(200)) + "\nHost: 127.0.0.1:{port}",
    ],
)
def test_it_gives_nothing_else(server, request_):
    given = {"path": server.path, "port": server.server_port, "swapped": server.path.swapcase()}
    found = answer(server, request_.format(**given))
    status = found.splitlines()[0].split()[1] if found.startswith("HTTP/") else "none"
    assert status in ("none", "400", "404", "414", "431", "501", "505") or not found.startswith("HTTP/")
    assert TEXT not in found
    assert "root:" not in found
    assert "<script>" not in found.partition("\r\n\r\n")[2]
    # And it goes on serving.
    test_it_answers_by_its_own_names(server, "localhost")


def test_its_address_cannot_be_guessed():
    paths = set()
    for _ in range(20):
        with PageServer(TEXT) as one:
            paths.add(one.path)
    assert len(paths) == 20
    assert all(len(path) >= 34 for path in paths)  # 192 bits
