"""The page of sparse maps can be run as it stands, and shows what is printed."""

import re
import threading
from contextlib import ExitStack
from pathlib import Path

import lidarium
from lidarium.mapping.sparse.path_server import PathServer
from lidarium.mapping.sparse.path_service import PathService

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "sparse_maps.md"
PORT = "4242"


def serve(sparse_map, ends):
    """Serve a map as the page's command does; return the port."""
    graph = lidarium.build_graph(sparse_map.free, sparse_map.boxes, lidarium.SweptBody(radius=0.25, height=1.2))
    server = ends.enter_context(PathServer(PathService(graph, Path("room.smap"))))
    threading.Thread(target=server.serve_forever, args=(0.01,)).start()
    ends.callback(server.shutdown)
    return str(server.port)


def test_code_prints_what_the_page_shows(capsys):
    names = {"__name__": PAGE.stem}
    blocks = re.findall(r"^```(python|text)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert [language for language, _ in blocks] == ["python", "text"] * 4
    with ExitStack() as ends:
        for language, content in blocks:
            if language == "text":
                assert capsys.readouterr().out == content
                continue
            if PORT in content:
                content = content.replace(PORT, serve(names["room"], ends))
            exec(compile(content, str(PAGE), "exec"), names)
