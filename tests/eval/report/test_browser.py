"""The pages in a headless browser: nothing overflows or fails, nothing is fetched, and a click shows a candidate."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from semslam.eval.report.page import make_comparison, make_report, make_suite
from tests.eval.report.samples import COMPARISON, REPORT, SUITE

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
PAGES = {"run": make_report(REPORT), "comparison": make_comparison(COMPARISON), "suite": make_suite(SUITE)}
PATIENCE_MS = 300_000
"""A busy machine may take its time."""
SIZES = {"desktop": (1400, 900), "phone": (390, 844)}


@pytest.fixture(scope="module")
def browser() -> Iterator["sync_api.Browser"]:
    """Headless Chromium: the system's, or playwright's own."""
    system = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_api.sync_playwright() as playwright:
        try:
            started = playwright.chromium.launch(executable_path=system, args=["--no-sandbox"], timeout=PATIENCE_MS)
        except sync_api.Error as error:
            pytest.skip(f"no browser can be started: {str(error).splitlines()[0]}")
        yield started
        started.close()


class Visit:
    """A page that is open, what it complained of and what it asked the network for."""

    def __init__(self, browser: "sync_api.Browser", file: Path, size: tuple[int, int]) -> None:
        self.page = browser.new_page(viewport={"width": size[0], "height": size[1]})
        self.page.set_default_timeout(PATIENCE_MS)
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", lambda m: self.complaints.append(m.text) if m.type in ("error", "warning") else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())
        if self.page.locator("#view").count():
            self.page.wait_for_selector("#view .main-svg")

    @property
    def fetched(self) -> list[str]:
        return [url for url in self.requests if not url.startswith(("file:", "data:", "blob:"))]

    def overflow(self, selector: str = "html") -> int:
        """Pixels by which an element is wider inside than it is."""
        return int(self.page.eval_on_selector(selector, "e => e.scrollWidth - e.clientWidth"))


@pytest.fixture(scope="module", params=[(name, size) for name in PAGES for size in SIZES], ids="-".join)
def visit(
    request: pytest.FixtureRequest, browser: "sync_api.Browser", tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Visit]:
    """Each page, on a desktop and on a phone."""
    name, size = request.param
    file = tmp_path_factory.mktemp(name) / "report.html"
    file.write_text(PAGES[name], encoding="utf-8")
    opened = Visit(browser, file, SIZES[size])
    yield opened
    opened.page.close()


ON_RUNS = pytest.mark.parametrize("visit", [("run", size) for size in SIZES], ids=SIZES, indirect=True)


@pytest.fixture
def run_page(visit: Visit) -> Visit:
    """The page of a run as it is when it has just been opened."""
    visit.page.evaluate(
        "document.querySelectorAll('dialog').forEach(d => d.close()); const form = document.getElementById('filters');"
        "form.reset(); form.dispatchEvent(new Event('input')); document.querySelector('[name=masks]').checked = false"
    )
    return visit


def test_nothing_overflows_or_fails_or_is_fetched(visit: Visit) -> None:
    assert visit.overflow() == 0
    assert visit.complaints == []
    assert visit.fetched == []


@pytest.mark.parametrize("visit", [("comparison", "desktop"), ("suite", "desktop")], indirect=True)
def test_tables_of_comparisons_are_no_wider_than_a_desktop(visit: Visit) -> None:
    assert visit.overflow(".scroll") == 0


@ON_RUNS
def test_a_click_shows_both_frames_and_all_values(run_page: Visit) -> None:
    page = run_page.page
    assert not page.locator("#loop").is_visible()
    page.locator("#loops tbody tr").first.click()
    assert page.locator("#loop").is_visible()
    assert page.locator("#pictures image").count() == 2
    assert page.locator("#pictures text").count() == 2
    assert "inliers88" in (page.locator("#values").text_content() or "").replace(" ", "")
    page.locator("[name=masks]").set_checked(True)
    assert page.locator("#pictures image").count() == 4
    assert page.locator("#legend").text_content() == "wall"
    assert run_page.overflow("#loop") == 0
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Escape")
    assert not page.locator("#loop").is_visible()
    assert run_page.complaints == []


@ON_RUNS
def test_rejected_and_withdrawn_candidates_are_shown_too(run_page: Visit) -> None:
    page = run_page.page
    for kind in ("rejected", "withdrawn"):
        page.locator("[name=kind]").select_option(kind)
        assert page.locator("#loops tbody tr").count() == 1
        page.locator("#loops tbody tr").click()
        assert kind in (page.locator("#loop-reason").text_content() or "")
        assert page.locator("#pictures image").count() == 2
        page.keyboard.press("Escape")


@ON_RUNS
def test_the_table_sorts_and_filters(run_page: Visit) -> None:
    page = run_page.page
    rows = page.locator("#loops tbody tr")
    page.get_by_role("button", name="outcome").click()
    first = rows.first.text_content()
    page.get_by_role("button", name="outcome").click()
    assert rows.first.text_content() != first
    page.locator("[name=reason]").select_option("few inliers")
    assert rows.count() == 1
    page.locator("[name=reason]").select_option("")
    page.locator("[name=least]").fill("0.95")
    assert rows.count() == 0
    assert (page.locator("#count").text_content() or "").startswith("0 of")


@ON_RUNS
def test_a_click_into_the_timeline_shows_the_candidate(run_page: Visit) -> None:
    page = run_page.page
    page.eval_on_selector("#timeline", "plot => plot.emit('plotly_click', {points: [{customdata: 2}]})")
    assert page.locator("#loop").is_visible()
    assert "false" in (page.locator("#loop-reason").text_content() or "")
