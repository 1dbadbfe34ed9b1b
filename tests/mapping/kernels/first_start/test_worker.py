"""A process that compiles kernels answers each line with a line."""

import io
import json

from lidarium.mapping.kernels.first_start import worker


def test_each_kernel_is_answered_and_one_that_fails_is_left_out(monkeypatch, capsys):
    asked = []

    def compiled(entry):
        asked.append(entry["name"])
        if entry["name"] == "a:bad":
            raise AttributeError("there is none")

    monkeypatch.setattr(worker, "compile_kernel", compiled)
    entries = [json.dumps({"name": name, "signature": []}) for name in ("a:good", "a:bad", "b:good")]
    monkeypatch.setattr("sys.stdin", io.StringIO("\n".join([*entries[:2], "no json", entries[2]]) + "\n"))
    worker.main()
    assert asked == ["a:good", "a:bad", "b:good"]
    assert capsys.readouterr().out.splitlines() == [
        "compiled",
        "left out: AttributeError",
        "left out: JSONDecodeError",
        "compiled",
    ]
