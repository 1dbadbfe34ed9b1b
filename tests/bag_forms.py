"""Bags in all forms in which ROS writes them, made from an MCAP file by `rosbags`."""

import tempfile
from pathlib import Path


def _messages(path):
    from mcap.reader import make_reader

    with open(path, "rb") as file:
        return [
            (schema.name, channel.topic, message.log_time, message.data)
            for schema, channel, message in make_reader(file).iter_messages()
        ]


def _write(writer, messages, convert, store):
    connections = {}
    for kind, topic, time, content in messages:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], time, convert(content, kind))


def write_folder(folder, source, storage, mode=None, part=slice(None)):
    """Write a bag of ROS 2, a folder; messages, files or storages can be compressed."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    from lidarium.mapping.files.bags.messages import typestore

    writer = Writer(folder, version=9, storage_plugin=StoragePlugin[storage])
    if mode is not None:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        _write(writer, _messages(source)[part], lambda content, kind: content, typestore())


def write_form(path, source):
    """Write a bag of the form that a file's name asks for: .db3, .bag, or these compressed."""
    path = Path(path)
    if path.suffix == ".bag":
        from rosbags.rosbag1 import Writer

        from lidarium.mapping.files.bags.messages import typestore

        store = typestore(is_ros1=True)
        writer = Writer(path)
        for name in ("lz4", "bz2"):
            if name in path.stem:
                writer.set_compression(Writer.CompressionFormat[name.upper()])
        with writer:
            _write(writer, _messages(source), typestore().cdr_to_ros1, store)
        return
    import zstandard

    with tempfile.TemporaryDirectory() as folder:
        write_folder(Path(folder, "bag"), source, "SQLITE3")
        content = Path(folder, "bag", "bag.db3").read_bytes()
    path.write_bytes(zstandard.compress(content) if path.suffix == ".zstd" else content)
