"""The bench: what the service says of a cluster is what the page shows."""

import base64
import json
import math
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
from playwright.sync_api import expect

SAMPLES = Path(__file__).parents[2] / "console/public/samples"


def pick(page, name):
    """The answer that the service gave to a sample, once it is shown."""
    with page.expect_response("**/v1/recognise?*") as answered:
        page.get_by_role("button", name=re.compile(name)).click()
    page.locator("#results:not([hidden]):not(.old)").wait_for()
    return answered.value.json()


def test_the_answer_is_shown(bench):
    said = pick(bench, "Fishing boat")
    verdict = bench.locator("#verdict")
    expect(verdict.get_by_role("heading")).to_contain_text("fishing boat")
    expect(verdict).to_contain_text(f"{math.degrees(said['heading']):.1f}°")
    expect(verdict).to_contain_text(f"{said['measured_points']} measured, {said['inferred_points']} inferred")
    first = bench.locator("#classes tr").first
    expect(first).to_contain_text(re.compile("fishing boat.*99"))
    assert bench.locator("#classes tr").count() == len(said["probabilities"])
    expect(bench.locator("#times tbody tr")).to_have_count(len(said["stage_ms"]))
    expect(bench.locator("#descriptors canvas")).to_have_count(5 * len(said["keypoints"]))
    told = bench.locator("#said")  # to those who listen
    expect(told).to_have_attribute("aria-live", "polite")
    expect(told).to_contain_text("fishing boat, 9")


def test_the_images_are_those_of_the_answer(bench):
    said = pick(bench, "RHIB")
    shown = bench.locator("#images canvas").evaluate_all(
        "all => all.map(one => [...one.getContext('2d').getImageData(0, 0, one.width, one.height).data])"
    )
    for encoded, pixels in zip((said["images"]["before"], said["images"]["after"]), shown, strict=True):
        assert np.array_equal(decoded(encoded), np.array(pixels, np.uint8).reshape(32, 64, 4)[..., :3])
    described = bench.locator("#descriptors canvas").evaluate_all(
        "all => all.map(one => [...one.getContext('2d').getImageData(0, 0, 32, 16).data])"
    )
    grey = np.concatenate([decoded(one)[..., 0].reshape(5, 16, 32) for one in said["descriptors"]])
    assert np.array_equal(grey, np.array(described, np.uint8).reshape(15, 16, 32, 4)[..., 0])


def decoded(encoded):
    """Red, green, blue of a PNG in base64."""
    content = np.frombuffer(base64.b64decode(encoded), np.uint8)
    return cv2.cvtColor(cv2.imdecode(content, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)


def test_measured_and_inferred_points_are_told_apart_and_can_be_hidden(bench):
    said = pick(bench, "Tug.*85")
    expect(bench.locator("#count-measured")).to_have_text(str(said["measured_points"]))
    expect(bench.locator("#count-inferred")).to_have_text(str(said["inferred_points"]))
    bench.get_by_role("button", name="Above").click()
    both = colours(bench)
    bench.get_by_role("checkbox", name="Inferred").uncheck()
    measured = colours(bench, until=lambda seen: seen["blue"] == 0)
    assert both["blue"] > 100
    assert measured["orange"] > 50
    bench.get_by_role("checkbox", name="Measured").uncheck()
    bench.get_by_role("checkbox", name="Raw cluster").uncheck()
    assert colours(bench, until=lambda seen: seen["orange"] == 0)["blue"] == 0


def colours(page, until=lambda seen: True):
    """How many pixels of the 3D view are orange and blue: measured and inferred."""
    for _ in range(100):
        shot = page.locator("#scene canvas").screenshot()
        red, _, blue = cv2.cvtColor(cv2.imdecode(np.frombuffer(shot, np.uint8), 1), cv2.COLOR_BGR2RGB).T.astype(
            int
        )
        seen = {
            "orange": int(((red > 150) & (red > blue + 80)).sum()),
            "blue": int(((blue > 150) & (blue > red + 80)).sum()),
        }
        if until(seen):
            return seen
    pytest.fail(f"the picture never came: {seen}")


def test_a_stranger_is_called_unknown_and_why(bench):
    said = pick(bench, "Landing craft")
    assert said["unknown"]
    expect(bench.locator("#verdict").get_by_role("heading")).to_contain_text("Unknown vessel")
    expect(bench.locator("#verdict")).to_contain_text("like nothing in the catalogue")


def test_how_it_is_computed_is_what_was_chosen(bench):
    pick(bench, "RHIB")
    expect(bench.get_by_label("Image method")).to_be_disabled()
    bench.get_by_label("Preset").select_option("paper")
    bench.get_by_label("Image method").select_option("z_top")
    bench.get_by_label("Own true heading").fill("90")
    with bench.expect_response("**/v1/recognise?*") as answered:
        bench.get_by_role("button", name="Recognise").click()
    said = answered.value.json()
    assert (said["preset"], said["image_method"]) == ("paper", "z_top")
    expect(bench.locator("#verdict")).to_contain_text(f"{said['true_heading_deg']:.1f}°")


def test_a_refusal_is_shown_as_its_sentence(bench, tmp_path):
    np.save(tmp_path / "few.npy", np.float32([[30, 0, 0], [31, 0, 0], [32, 1, 1]]))
    with bench.expect_response("**/v1/recognise?*") as answered:
        bench.locator("#file").set_input_files(tmp_path / "few.npy")
    refusal = answered.value.json()
    assert answered.value.status == 422
    alert = bench.get_by_role("alert").filter(has_text=refusal["detail"])
    expect(alert).to_contain_text(refusal["request_id"])
    pick(bench, "RHIB")
    expect(alert).to_be_hidden()


def test_a_deadline_that_cannot_be_held_is_said(bench):
    bench.get_by_label("Deadline").fill("0.001")
    with bench.expect_response("**/v1/recognise?*") as answered:
        bench.get_by_role("button", name=re.compile("RHIB")).click()
    expect(bench.locator("#problem")).to_contain_text(answered.value.json()["detail"])


def test_an_answer_of_a_lower_rung_says_what_it_lacks_and_why(bench):
    def cheaper(route):
        said = route.fetch().json() | {
            "rung": "heading_and_box",
            "rung_reason": "expected 9 ms until the deadline, got 4",
            "keypoints": [],
            "images": None,
            "descriptors": None,
            "inferred_points": 0,
        }
        points, measured = said["restored"]["points"], said["restored"]["measured"]
        kept = [point for point, seen in zip(points, measured, strict=True) if seen]
        route.fulfill(json=said | {"restored": {"points": kept, "measured": [True] * len(kept)}})

    bench.route("**/v1/recognise?*", cheaper)
    pick(bench, "RHIB")
    for place in ("#verdict", "#images", "#descriptors"):
        expect(bench.locator(place)).to_contain_text("heading and box: expected 9 ms until the deadline, got 4")
    for layer in ("Inferred", "Keypoints"):
        expect(bench.get_by_role("checkbox", name=layer)).to_be_disabled()


def test_an_overloaded_service_says_when_to_come_back(bench):
    document = {"detail": "expected room in the queue, got none", "error": "overloaded", "request_id": "r-7"}
    headers = {"Shipshape-Retry-After-Ms": "1500", "Content-Type": "application/problem+json"}
    refusal = json.dumps(document)
    bench.route("**/v1/recognise?*", lambda route: route.fulfill(status=429, headers=headers, body=refusal))
    bench.get_by_role("button", name=re.compile("RHIB")).click()
    for said in (document["detail"], "overloaded", "Come back in 1.50 s", "r-7"):
        expect(bench.locator("#problem")).to_contain_text(said)


@pytest.mark.skipif(shutil.which("curl") is None, reason="curl is not installed")
def test_the_command_that_is_shown_repeats_the_answer(bench, tmp_path):
    said = pick(bench, "Pilot boat.*64")
    with bench.expect_download() as downloaded:
        bench.get_by_role("button", name="Download the points").click()
    downloaded.value.save_as(tmp_path / downloaded.value.suggested_filename)
    command = shlex.split(bench.locator("#curl").inner_text().replace("\\\n", " "))
    assert command[0] == "curl"
    ran = subprocess.run([*command, "--noproxy", "*"], cwd=tmp_path, capture_output=True, check=True, timeout=60)
    again = json.loads(ran.stdout)
    del said["stage_ms"], again["stage_ms"]
    assert again == said


def test_without_webgl_everything_else_works(opened, address):
    with opened(address) as page:
        page.add_init_script("HTMLCanvasElement.prototype.getContext = new Proxy("
                             "HTMLCanvasElement.prototype.getContext, {apply: (get, canvas, given) => "
                             "given[0].startsWith('webgl') ? null : get.apply(canvas, given)});")  # fmt: skip
        page.reload()
        pick(page, "RHIB")
        expect(page.locator("#scene")).to_contain_text("draws no 3D")
        expect(page.locator("#classes tr").first).to_contain_text("rhib")


def test_the_samples_are_what_their_buttons_say(address):
    samples = httpx.get(f"{address}console/samples/samples.json", trust_env=False).json()
    assert len(samples) >= 6
    for sample in samples:
        points = np.load(SAMPLES / sample["file"])
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        assert f"{len(points)} points" in sample["text"]
        assert math.hypot(*middle[:2]) == pytest.approx(float(sample["text"].split()[0]), abs=15)
