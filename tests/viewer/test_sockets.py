"""Whatever starts a server lets nobody in from outside: loopback only, in tests as well."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest
from screens import Screen
from sockets import listening

from handtrack.viewer.process import free_port, viewer, wait_for

ROOT = Path(__file__).resolve().parents[2]
linux = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="reads Linux's /proc")

# rerun's own ways to start one listen on all addresses, and cannot be told otherwise
OPEN_TO_ALL = {"spawn", "serve_grpc", "serve_web", "serve_web_viewer", "start_web_viewer_server"}


def server_calls(text: str) -> list[int]:
    """Lines that call one of them."""
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call)]
    return [c.lineno for c in calls if getattr(c.func, "attr", "") in OPEN_TO_ALL]


def test_nothing_is_started_that_listens_on_all_addresses() -> None:
    assert server_calls("import rerun as rr\nrr.spawn()\nviewer.ViewerClient.spawn(port=1)") == [
        2,
        3,
    ]
    files = [
        path for part in ("handtrack", "tests", "tools") for path in (ROOT / part).rglob("*.py")
    ]
    assert len(files) > 100
    found = {
        str(p.relative_to(ROOT)): lines for p in files if (lines := server_calls(p.read_text()))
    }
    assert found == {}


@linux
def test_a_server_of_ours_listens_on_loopback() -> None:
    port = free_port()
    with viewer("--serve-grpc", "--port", str(port)) as process:
        wait_for(process, port)
        assert listening(process.pid) == [("127.0.0.1", port)]


@linux
def test_the_viewer_that_draws_listens_on_loopback(screen: Screen) -> None:
    found = listening(screen.pid)
    assert f"127.0.0.1:{found[0][1]}" == screen.address
    assert {address for address, _ in found} == {"127.0.0.1"}
