"""Which references of other projects the site links into: those that can be had."""

from __future__ import annotations

import http.server
import threading

from tools.docs.elsewhere import to_be_had


def test_only_what_answers_is_linked_into_and_the_rest_is_said(tmp_path, capsys):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "objects.inv").write_bytes(b"# Sphinx inventory version 2\n")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *given):
            super().__init__(*given, directory=str(tmp_path))

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        here = f"http://127.0.0.1:{server.server_port}"
        found = to_be_had({"there": f"{here}/there", "gone": f"{here}/gone"})
        server.shutdown()
    assert found == ["there"]
    nobody = to_be_had({"nobody": here})
    assert nobody == []
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "no links into the reference of gone: HTTP Error 404: File not found"
    assert said[1].startswith("no links into the reference of nobody: <urlopen error ")
