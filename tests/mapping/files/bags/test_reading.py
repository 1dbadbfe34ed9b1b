"""Logs come back from bags in all forms; damaged and harmful ones are refused."""

import io
import math
import shutil
import sqlite3
from contextlib import closing, suppress
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="rosbags is not installed: extra [bags]")

import zstandard
from bag_forms import write_folder, write_form
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer

from lidarium.mapping.files.bags.messages import LASER_SCAN, decoder, typestore
from lidarium.mapping.files.bags.reading import read_bag_log
from lidarium.mapping.files.bags.writing import bag, write_mcap_log
from lidarium.mapping.files.laser_logs import LaserLog
from lidarium.mapping.grids.scan_geometry import ScanGeometry

GEOMETRY = ScanGeometry(beams=9, field_of_view=math.pi, range_min=0.1, range_max=5.0)


def decoded(path):
    with open(path, "rb") as file:
        return [
            (channel.topic, decoder(False)(message.data, schema.name))
            for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages()
        ]


def same_turns(a, b):
    return np.allclose(np.cos(a - b), 1.0, atol=1e-12)


def test_a_log_comes_back(log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", log)
    found = read_bag_log(tmp_path / "log.mcap")
    assert np.array_equal(found.ranges, log.ranges, equal_nan=True)
    assert np.allclose(found.stamps, log.stamps, atol=1e-9)
    assert np.allclose(found.odometry[:, :2], log.odometry[:, :2], atol=1e-12)
    assert same_turns(found.odometry[:, 2], log.odometry[:, 2])
    assert np.allclose(found.laser_pose, log.laser_pose, atol=1e-6)
    assert (found.geometry.beams, found.skipped, found.remarks) == (9, {}, ())
    assert found.geometry.field_of_view == pytest.approx(math.pi, abs=1e-6)


def test_beams_that_are_taken_one_after_the_other_come_back(log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", replace(log, beam_interval_s=0.001))
    (scan,) = [content for topic, content in decoded(tmp_path / "log.mcap") if topic == "/robot/scan"][:1]
    # A message has the time of its first beam, a log that of the last.
    assert scan.header.stamp.sec + 1e-9 * scan.header.stamp.nanosec == pytest.approx(3.0 - 0.008)
    found = read_bag_log(tmp_path / "log.mcap")
    assert found.beam_interval_s == pytest.approx(0.001)
    assert np.allclose(found.stamps, log.stamps, atol=1e-8)


def write_all(writer):
    writer.scan("/scan", "odd", 2.5, np.arange(9, dtype=np.float32) * 0.5, GEOMETRY)
    writer.odometry("/odom", "odom", "base_link", 2.5, (1.0, -2.0, 0.5))
    writer.transform("map", "odom", 2.5, (1.0, 2.0, -1.5), height=0.25)
    levels = np.array([[0, 127, 255], [255, 255, 127]], np.uint8)
    writer.grid("/map", "map", 2.5, levels, (-1.0, -2.0), 0.05)
    writer.path("/path", "map", 2.5, [1.0, 2.0], np.array([[0.0, 1.0, 2.0], [0.5, 1.5, -2.0]]))


def test_times_of_a_bag_are_those_of_its_messages(tmp_path):
    with bag(tmp_path / "all.mcap") as writer:
        write_all(writer)
    with open(tmp_path / "all.mcap", "rb") as file:
        reader = make_reader(file)
        assert {message.log_time for _, _, message in reader.iter_messages()} == {2_500_000_000}
        assert reader.get_header().profile == "ros2"
        encodings = {schema.encoding for schema in reader.get_summary().schemas.values()}
        assert encodings == {"ros2msg"}


def test_a_bag_without_scans_is_refused(tmp_path):
    with bag(tmp_path / "empty.mcap") as writer:
        writer.odometry("/odom", "odom", "base_link", 0.0, np.zeros(3))
    with pytest.raises(ValueError, match=r"empty.mcap holds no scans; want a topic of sensor_msgs/msg/LaserScan"):
        read_bag_log(tmp_path / "empty.mcap")


def test_of_several_topics_one_has_to_be_chosen(log, tmp_path):
    with bag(tmp_path / "two.mcap") as writer:
        for robot in ("a", "b"):
            for k in range(3):
                writer.odometry(
                    f"/{robot}/odom",
                    "odom",
                    "base_link",
                    float(k),
                    (k * (1.0 if robot == "a" else -1.0), 0, 0),
                )
                writer.scan(f"/{robot}/scan", "laser", float(k), log.ranges[k], GEOMETRY)
    with pytest.raises(ValueError, match=r"scans on 2 topics; choose one by --topic: /a/scan, /b/scan"):
        read_bag_log(tmp_path / "two.mcap")
    with pytest.raises(ValueError, match=r"no scans on topic '/c/scan'; want one of /a/scan, /b/scan"):
        read_bag_log(tmp_path / "two.mcap", "/c/scan")
    assert read_bag_log(tmp_path / "two.mcap", "/b/scan").odometry[:, 0].tolist() == [0.0, -1.0, -2.0]
    assert read_bag_log(tmp_path / "two.mcap", "/a/scan").odometry[:, 0].tolist() == [0.0, 1.0, 2.0]


def test_without_odometry_transforms_say_where_the_robot_is(log, tmp_path):
    with bag(tmp_path / "tf.mcap") as writer:
        for k in range(4):
            writer.transform("map", "odom", float(k), (5.0, 5.0, 0.0))
            writer.transform("odom", "base", float(k), (0.5 * k, 0.0, 0.0))
            writer.scan("/scan", "laser", float(k), log.ranges[k], GEOMETRY)
        writer.transform("base", "laser", 0.0, (0.2, 0.0, 0.0), is_static=True)
    found = read_bag_log(tmp_path / "tf.mcap")
    assert np.allclose(found.odometry[:, 0], [0.0, 0.5, 1.0, 1.5])
    assert np.allclose(found.laser_pose, [0.2, 0.0, 0.0], atol=1e-6)


def test_without_both_there_is_no_odometry(log, tmp_path):
    write_mcap_log(tmp_path / "bare.mcap", replace(log, odometry=None))
    assert read_bag_log(tmp_path / "bare.mcap").odometry is None


def test_a_laser_that_turns_clockwise_and_scans_of_other_lengths_are_read(log, tmp_path):
    class Clockwise:
        beams, range_min, range_max = 9, 0.1, 5.0
        angle_first, angle_increment = -GEOMETRY.angle_first, -GEOMETRY.angle_increment

    with bag(tmp_path / "odd.mcap") as writer:
        for k in range(5):
            beams = 9 if k != 2 else 4
            writer.scan("/scan", "laser", float(k), log.ranges[k][:beams], Clockwise())
    found = read_bag_log(tmp_path / "odd.mcap")
    assert not found.skipped
    assert any("1 x scans whose beams are not as those of most" in remark for remark in found.remarks)
    assert np.array_equal(found.ranges[[0, 1, 3, 4]], log.ranges[[0, 1, 3, 4], ::-1], equal_nan=True)
    # Four beams from the left: the others of that scan are invalid.
    assert np.array_equal(found.ranges[2, 5:], log.ranges[2, 3::-1])
    assert np.isnan(found.ranges[2, :5]).all()


def test_a_chain_of_transforms_says_where_the_laser_is(log, tmp_path):
    with bag(tmp_path / "chain.mcap") as writer:
        writer.transform("base_footprint", "base_link", 0.0, (0.1, 0.0, 0.0), height=0.1, is_static=True)
        for k, ranges in enumerate(log.ranges):
            writer.transform("base_link", "laser", 0.25 * k, (0.2, 0.0, math.pi / 2))
            writer.odometry("/odom", "odom", "base_footprint", 0.25 * k, log.odometry[k])
            writer.scan("/scan", "laser", 0.25 * k, ranges, GEOMETRY)
    found = read_bag_log(tmp_path / "chain.mcap")
    assert np.allclose(found.laser_pose, [0.3, 0.0, math.pi / 2], atol=1e-6)
    assert not found.remarks


def test_a_laser_without_a_place_is_told(log, tmp_path):
    with bag(tmp_path / "bare.mcap") as writer:
        for k, ranges in enumerate(log.ranges):
            writer.odometry("/odom", "odom", "base", 0.25 * k, log.odometry[k])
            writer.scan("/scan", "laser", 0.25 * k, ranges, GEOMETRY)
    (remark,) = read_bag_log(tmp_path / "bare.mcap").remarks
    assert "no transforms say where the laser (laser) is on the robot (base)" in remark


def test_transforms_of_another_robot_are_not_mixed_in(log, tmp_path):
    with bag(tmp_path / "two.mcap") as writer:
        for k, ranges in enumerate(log.ranges):
            writer.odometry("/a/odom", "odom", "base", 0.25 * k, log.odometry[k])
            writer.scan("/a/scan", "laser", 0.25 * k, ranges, GEOMETRY)
        for robot, ahead in (("b", 0.5), ("a", 0.2)):
            writer.transform("base", "laser", 0.0, (ahead, 0.0, 0.0), is_static=True, topic=f"/{robot}/tf_static")
    assert np.allclose(read_bag_log(tmp_path / "two.mcap").laser_pose, [0.2, 0.0, 0.0], atol=1e-6)


def test_odometry_that_is_missing_while_the_robot_moves_is_unknown(log, tmp_path):
    with bag(tmp_path / "gap.mcap") as writer:
        for k, ranges in enumerate(log.ranges):
            if not 6 <= k < 14:
                writer.odometry("/odom", "odom", "base", 0.25 * k, log.odometry[k])
            writer.scan("/scan", "base", 0.25 * k, ranges, GEOMETRY)
    found = read_bag_log(tmp_path / "gap.mcap")
    assert np.flatnonzero(np.isnan(found.odometry[:, 0])).tolist() == list(range(6, 14))


def test_no_return_is_the_longest_range_in_bags_as_in_logs(log, tmp_path):
    ranges = log.ranges.copy()
    ranges[:, 4] = 5.0
    write_mcap_log(tmp_path / "log.mcap", replace(log, ranges=ranges))
    assert np.isinf(read_bag_log(tmp_path / "log.mcap").ranges[:, 4]).all()


def test_what_is_cut_off_or_damaged_is_refused_by_name(log, tmp_path):
    write_mcap_log(tmp_path / "whole.mcap", log)
    content = (tmp_path / "whole.mcap").read_bytes()
    draws = np.random.default_rng(7)
    for size in [0, 5, 8, 100, *draws.integers(9, len(content) - 1, 40).tolist()]:
        (tmp_path / "cut.mcap").write_bytes(content[:size])
        with pytest.raises(ValueError, match=r"cut.mcap"):
            read_bag_log(tmp_path / "cut.mcap")
    for place in draws.integers(0, len(content), 60).tolist():
        damaged = bytearray(content)
        damaged[place] ^= 0xFF
        (tmp_path / "damaged.mcap").write_bytes(damaged)
        with suppress(ValueError):  # where damage is that nobody needs, the scans are as they were
            found = read_bag_log(tmp_path / "damaged.mcap")
            assert np.array_equal(found.ranges, log.ranges, equal_nan=True)


def test_a_bag_of_something_else_is_refused(tmp_path):
    with open(tmp_path / "json.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/scan", "json", writer.register_schema("Scan", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(ValueError, match=r"json.mcap holds no scans"):
        read_bag_log(tmp_path / "json.mcap")
    with open(tmp_path / "protobuf.mcap", "wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(LASER_SCAN, "protobuf", b"")
        writer.add_message(writer.register_channel("/scan", "protobuf", schema), 0, b"\x00\x01\x00\x00", 0)
        writer.finish()
    with pytest.raises(ValueError, match=r"protobuf.mcap has messages in protobuf; want a whole bag of ROS"):
        read_bag_log(tmp_path / "protobuf.mcap")
    (tmp_path / "text.mcap").write_text("no bag")
    with pytest.raises(ValueError, match=r"text.mcap is not a whole bag"):
        read_bag_log(tmp_path / "text.mcap")
    with pytest.raises(FileNotFoundError, match=r"no file"):
        read_bag_log(tmp_path / "nowhere.mcap")


def bombed(path, *, says: int | None = None, compression=CompressionType.ZSTD):
    """Write a bag with a chunk of 200 MB of zeros; it may say to have another size."""
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=1 << 30, compression=compression)
        writer.start()
        schema = writer.register_schema(LASER_SCAN, "ros2msg", b"")
        writer.add_message(writer.register_channel("/scan", "cdr", schema), 0, bytes(200_000_000), 0)
        writer.finish()
    if says is not None:
        content = path.read_bytes()
        size = make_reader(io.BytesIO(content)).get_summary().chunk_indexes[0].uncompressed_size
        path.write_bytes(content.replace(size.to_bytes(8, "little"), says.to_bytes(8, "little")))


def test_a_bag_that_unpacks_to_more_than_it_may_is_refused_before_it_is_unpacked(tmp_path):
    bombed(tmp_path / "bag.mcap")
    with pytest.raises(ValueError, match=r"bag.mcap has more than [\d,]+ bytes when unpacked; want fewer"):
        read_bag_log(tmp_path / "bag.mcap")


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_chunk_of_another_size_than_it_says_is_refused(compression, tmp_path):
    bombed(tmp_path / "bag.mcap", says=1000, compression=compression)
    # LZ4 states the size in its own header, too, with a checksum.
    words = "has a chunk of another size than it says|headerChecksum_invalid"
    with pytest.raises(ValueError, match=rf"bag.mcap .*({words})"):
        read_bag_log(tmp_path / "bag.mcap")


def test_scans_that_pack_too_well_are_refused(log, tmp_path):
    geometry = ScanGeometry(beams=10_000, field_of_view=math.pi, range_max=5.0)
    alike = LaserLog(np.arange(200.0), np.ones((200, 10_000), np.float32), geometry, np.zeros((200, 3)))
    write_mcap_log(tmp_path / "log.mcap", alike)
    with pytest.raises(ValueError, match=r"log.mcap packs its scans too well; want a bag of a robot"):
        read_bag_log(tmp_path / "log.mcap")


def same_logs(found, log):
    return np.array_equal(found.ranges, log.ranges, equal_nan=True) and np.array_equal(found.odometry, log.odometry)


@pytest.mark.parametrize("name", ["a.db3", "a.db3.zstd", "a.bag", "lz4.bag", "bz2.bag"])
def test_every_form_of_a_file_holds_the_same_log(name, log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", log)
    write_form(tmp_path / name, tmp_path / "log.mcap")
    found, expected = read_bag_log(tmp_path / name), read_bag_log(tmp_path / "log.mcap")
    assert same_logs(found, expected)
    assert np.array_equal(found.laser_pose, expected.laser_pose)


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
@pytest.mark.parametrize("mode", [None, "FILE", "MESSAGE", "STORAGE"])
def test_every_form_of_a_folder_holds_the_same_log(storage, mode, log, tmp_path):
    if (storage, mode) == ("SQLITE3", "STORAGE"):
        pytest.skip("sqlite has no compression")
    write_mcap_log(tmp_path / "log.mcap", log)
    write_folder(tmp_path / "bag", tmp_path / "log.mcap", storage, mode)
    assert same_logs(read_bag_log(tmp_path / "bag"), read_bag_log(tmp_path / "log.mcap"))


def test_parts_of_a_split_bag_are_one_log(log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", log)
    for number, part in (("9", slice(0, 20)), ("10", slice(20, None))):
        write_folder(tmp_path / "part", tmp_path / "log.mcap", "MCAP", part=part)
        (tmp_path / "bag").mkdir(exist_ok=True)
        (tmp_path / "part" / "part.mcap").rename(tmp_path / "bag" / f"bag_{number}.mcap")
        shutil.rmtree(tmp_path / "part")
    assert same_logs(read_bag_log(tmp_path / "bag"), read_bag_log(tmp_path / "log.mcap"))
    names = "".join(f"  - bag_{number}.mcap\n" for number in (9, 10, 11))
    (tmp_path / "bag" / "metadata.yaml").write_text(f"x:\n  relative_file_paths:\n{names}")
    with pytest.raises(ValueError, match=r"bag has no bag_11.mcap, which its metadata.yaml lists"):
        read_bag_log(tmp_path / "bag")


def test_a_folder_without_a_bag_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"is a folder without a bag; want a whole bag of ROS"):
        read_bag_log(tmp_path)


@pytest.mark.parametrize("form", ["sqlite", "split", "packed"])
def test_forms_that_ros_2_writes_are_read(form, shared_cases):
    log = read_bag_log(shared_cases / "bag-forms" / form)
    assert len(log.stamps) == 100
    assert log.odometry is not None


def test_frames_of_ros_1_may_begin_with_a_slash(log, tmp_path):
    with bag(tmp_path / "log.mcap") as writer:
        writer.transform("base", "/laser", 0.0, (0.2, 0.0, 0.0), is_static=True)
        for k in range(3):
            writer.odometry("/odom", "odom", "/base", float(k), (k, 0.0, 0.0))
            writer.scan("/scan", "laser", float(k), log.ranges[k], GEOMETRY)
    write_form(tmp_path / "log.bag", tmp_path / "log.mcap")
    assert np.allclose(read_bag_log(tmp_path / "log.bag").laser_pose, [0.2, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("name", ["bz2.bag", "lz4.bag"])
def test_chunks_of_ros_1_that_unpack_to_gigabytes_are_refused(name, tmp_path):
    writer = Ros1Writer(tmp_path / name)
    writer.set_compression(Ros1Writer.CompressionFormat[name[:3].upper()])
    with writer:
        connection = writer.add_connection("/scan", LASER_SCAN, typestore=typestore(is_ros1=True))
        writer.write(connection, 0, bytes(100_000_000))
    with pytest.raises(ValueError, match=r"has more than [\d,]+ bytes when unpacked; want fewer"):
        read_bag_log(tmp_path / name)


def test_a_packed_file_that_unpacks_to_gigabytes_is_refused(tmp_path):
    (tmp_path / "a.mcap.zstd").write_bytes(zstandard.compress(bytes(300_000_000)))
    with pytest.raises(ValueError, match=r"has more than [\d,]+ bytes when unpacked; want fewer"):
        read_bag_log(tmp_path / "a.mcap.zstd")


def test_a_chunk_that_the_index_of_a_bag_lists_twice_is_refused(log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", log)
    write_form(tmp_path / "a.bag", tmp_path / "log.mcap")
    content = (tmp_path / "a.bag").read_bytes()
    once, twice = (b"chunk_count=" + count.to_bytes(4, "little") for count in (1, 2))
    assert once in content
    # The record of the one chunk is the last one: its header begins four bytes before the first field.
    start = content.rindex(b"\x04\x00\x00\x00op=\x06") - 4
    (tmp_path / "b.bag").write_bytes(content.replace(once, twice) + content[start:])
    with pytest.raises(ValueError, match=r"b.bag is not a whole bag.*lists a chunk twice"):
        read_bag_log(tmp_path / "b.bag")


TABLES = (
    "CREATE TABLE topics(id, name, type, serialization_format);"
    f"INSERT INTO topics VALUES (1, '/scan', '{LASER_SCAN}', 'cdr');"
)


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        (
            "CREATE VIEW messages AS WITH RECURSIVE n(k) AS (SELECT 1 UNION ALL SELECT k + 1 FROM n) "
            "SELECT 2 AS topic_id, k AS timestamp, x'00' AS data FROM n;",
            "interrupted",
        ),
        (
            "CREATE TABLE messages(topic_id, timestamp, data AS (zeroblob(900000000)));"
            "INSERT INTO messages(topic_id, timestamp) VALUES (1, 0);",
            "too big",
        ),
        (
            "CREATE TABLE messages(topic_id, timestamp, data AS (zeroblob(3000000)));"
            "INSERT INTO messages(topic_id, timestamp) VALUES (1, 0), (1, 1);",
            "packs its scans too well",
        ),
        ("CREATE TABLE messages(topic_id, timestamp, data); INSERT INTO messages VALUES (1, 'x', 'y');", "."),
        ("", "no such table"),
    ],
    ids=["endless", "large", "many", "wrong types", "no table"],
)
def test_sqlite_files_that_make_rows_of_nothing_are_refused(statements, words, tmp_path):
    with closing(sqlite3.connect(tmp_path / "a.db3")) as database:
        database.executescript(TABLES + statements)
    with pytest.raises(ValueError, match=rf"a.db3 .*{words}"):
        read_bag_log(tmp_path / "a.db3")


def test_sqlite_files_without_their_last_messages_are_refused(log, tmp_path):
    write_mcap_log(tmp_path / "log.mcap", log)
    write_form(tmp_path / "a.db3", tmp_path / "log.mcap")
    content = (tmp_path / "a.db3").read_bytes()
    (tmp_path / "cut.db3").write_bytes(content[:-60])
    with pytest.raises(ValueError, match=r"cut.db3 is not a whole bag, it is cut off"):
        read_bag_log(tmp_path / "cut.db3")
    with closing(sqlite3.connect(tmp_path / "a.db3")) as database:  # as the recorder that is killed leaves it
        database.executescript("PRAGMA journal_mode = WAL; DELETE FROM messages WHERE id > 9;")
        shutil.copy(tmp_path / "a.db3", tmp_path / "b.db3")
        shutil.copy(tmp_path / "a.db3-wal", tmp_path / "b.db3-wal")
    with pytest.raises(ValueError, match=r"b.db3 was not closed, its last messages are in b.db3-wal; want"):
        read_bag_log(tmp_path / "b.db3")


WIDE = ScanGeometry(beams=91, field_of_view=math.pi, range_min=0.1, range_max=20.0)


def driven(path, topic=None, transforms=(), odometry=(), moving=(), frames=("laser",)):
    """Return the log of a bag of ten scans in turn from frames, besides bodies that move by a direction each."""
    with bag(path) as writer:
        for parent, child, pose in transforms:
            writer.transform(parent, child, 0.0, pose, is_static=True)
        for k in range(10):
            for name, parent, child, way in odometry:
                writer.odometry(name, parent, child, 0.1 * k, 0.05 * k * np.array(way))
            for parent, child, way in moving:
                writer.transform(parent, child, 0.1 * k, 0.05 * k * np.array(way))
            for robot in ("r1", "r2") if topic else ("",):
                frame = frames[k % len(frames)]
                name, frame = (f"/{robot}/scan", f"{robot}/{frame}") if topic else ("/scan", frame)
                writer.scan(name, frame, 0.1 * k, np.full(91, 3.0, np.float32), WIDE)
    return read_bag_log(path, topic)


ALONG_X, ALONG_Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def test_of_two_robots_on_one_topic_of_transforms_each_has_its_own_odometry(tmp_path):
    mounted = [("r1/base", "r1/laser", (0.2, 0.0, 0.0)), ("r2/base", "r2/laser", (-0.3, 0.0, 0.0))]
    moving = [("r1/odom", "r1/base", ALONG_Y), ("r2/odom", "r2/base", ALONG_X)]
    for robot, last, ahead in (("r1", [0.0, 0.45, 0.0], 0.2), ("r2", [0.45, 0.0, 0.0], -0.3)):
        log = driven(tmp_path / f"{robot}.mcap", f"/{robot}/scan", mounted, moving=moving)
        assert log.odometry[-1] == pytest.approx(last)
        assert log.laser_pose == pytest.approx([ahead, 0.0, 0.0])
        assert not log.remarks


def test_odometry_is_that_of_the_body_with_the_laser_and_what_else_could_be_it_is_told(tmp_path):
    mounted = [("base_link", "laser", (0.2, 0.0, 0.0))]
    odometry = [("/camera/odom", "camera_odom", "camera_link", ALONG_Y), ("/wheel", "odom", "base_link", ALONG_X)]
    log = driven(tmp_path / "camera.mcap", None, mounted, odometry)
    assert log.odometry[-1] == pytest.approx([0.45, 0.0, 0.0])
    assert log.laser_pose == pytest.approx([0.2, 0.0, 0.0])
    assert not log.remarks
    odometry = [("/ground_truth/odom", "world", "base_link", ALONG_Y), ("/odom", "odom", "base_link", ALONG_X)]
    log = driven(tmp_path / "truth.mcap", None, mounted, odometry)
    assert log.odometry[-1] == pytest.approx([0.45, 0.0, 0.0])
    assert log.remarks == ("odometry is that of /odom, not of /ground_truth/odom",)


def test_scans_of_a_second_laser_on_the_same_topic_are_left_out(tmp_path):
    mounted = [("base", "front", (0.2, 0.0, 0.0)), ("base", "rear", (-0.2, 0.0, math.pi))]
    odometry = [("/odom", "odom", "base", ALONG_X)]
    log = driven(tmp_path / "two.mcap", None, mounted, odometry, frames=("front", "front", "rear"))
    assert len(log.stamps) == 7
    assert log.laser_pose == pytest.approx([0.2, 0.0, 0.0])
    assert log.skipped == {"scans in the frame rear, not front as most": 3}
