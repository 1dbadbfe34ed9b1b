"""The committed asset is what its source gives, and the wheel has it without its source."""

import shutil
import subprocess
from pathlib import Path

import pytest

from lidarium.evaluation.report import page

WEB = Path(__file__).parents[3] / "evaluation" / "report" / "web"
ASSET = WEB.parent / "data" / "page.html"


def test_the_asset_is_what_the_build_gives_to_the_byte(tmp_path):
    node = shutil.which("node")
    if node is None or not (WEB / "node_modules" / "esbuild").is_dir():
        pytest.skip("no node, or no node_modules: npm ci in evaluation/report/web")
    subprocess.run([node, "build.mjs", str(tmp_path / "page.html")], cwd=WEB, check=True, capture_output=True)
    assert (tmp_path / "page.html").read_bytes() == ASSET.read_bytes(), (
        "npm run build in evaluation/report/web, and commit"
    )


def test_the_asset_has_one_place_for_the_data_and_no_address():
    text = page.FRONT_END.read_text(encoding="utf-8")
    assert text.count("<!--data-->") == 1
    assert text.count("<!--title-->") == 1
    assert "sourceMappingURL" not in text
    assert text.replace("http://www.w3.org/2000/svg", "").count("://") == 0
    assert "Copyright (c) 2022 Leon Sorokin" in text


def test_sources_of_the_front_end_are_short():
    sources = sorted((WEB / "src").rglob("*.ts"))
    assert sources
    assert not [path.name for path in sources if len(path.read_text(encoding="utf-8").splitlines()) > 300]
    for folder in {path.parent for path in sources}:
        assert len(list(folder.iterdir())) <= 14, folder.name
