"""Pages in headless Chromium, used as a person uses them; skips with a reason where there is no Chromium."""

import shutil

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
WIDTH, HEIGHT = 1280, 800
"""Size of the screen [pixels]."""


PLAIN = ("--disable-gpu",)
SOLID = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""Options for pages that draw in three dimensions: WebGL without a graphics card."""


def headless_chromium(graphics=PLAIN):
    """Return a driver of a headless Chromium; the caller ends it with ``quit``."""
    try:
        from selenium import webdriver
    except ImportError as error:
        raise ValueError("selenium is not installed: extra [browser]") from error
    browser = next((path for path in map(shutil.which, BROWSERS) if path), None)
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        raise ValueError("no Chromium with its chromedriver; apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    # A container's root has no sandbox, and little shared memory.
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--hide-scrollbars",
        *graphics,
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    made = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    made.set_script_timeout(120)
    return made


def show_on_screen(driver, theme, width=WIDTH, height=HEIGHT):
    """Set the size of the screen and whether the system is light or dark."""
    driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride",
        {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False},
    )
    features = [
        {"name": "prefers-color-scheme", "value": theme},
        {"name": "prefers-reduced-motion", "value": "reduce"},
    ]
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})


def chromium(graphics=PLAIN):
    """Return a driver of a headless Chromium, or skip."""
    try:
        return headless_chromium(graphics)
    except ValueError as error:
        pytest.skip(str(error))


class Browser:
    """A page that is open.

    Parameters
    ----------
    driver : selenium driver
        Of `chromium`.
    """

    def __init__(self, driver):
        self.driver = driver

    def open(self, path, width=WIDTH, height=HEIGHT, theme="light"):
        """Open a file as on a screen of a size; nothing of the page before is left."""
        show_on_screen(self.driver, theme, width, height)
        self.driver.get("about:blank")
        self.driver.get_log("browser")
        self.driver.get(path.as_uri())
        # All pages from the disk share what one of them has stored.
        if self.run("return localStorage.length"):
            self.run("localStorage.clear()")
            self.driver.get(path.as_uri())

    def run(self, script, *arguments):
        """Run a script on the page and return what it returns."""
        return self.driver.execute_script(script, *arguments)

    def find(self, css, within=None):
        return (within or self.driver).find_element("css selector", css)

    def find_all(self, css, within=None):
        return (within or self.driver).find_elements("css selector", css)

    def labelled(self, label, within="body"):
        """Return the control of a label."""
        for field in self.find_all(f"{within} label"):
            if field.text.split("\n")[0].strip() == label:
                return self.find("select, input", field)
        raise AssertionError(f"no control is labelled {label!r}")

    def button(self, text, within="body"):
        """Return the button that says something."""
        found = [each for each in self.find_all(f"{within} button") if each.text.strip() == text]
        assert found, f"no button says {text!r}"
        return found[0]

    def choose(self, label, text, within="body"):
        """Choose an entry of a list by what it says."""
        from selenium.webdriver.support.ui import Select

        Select(self.labelled(label, within)).select_by_visible_text(text)

    def keys(self, *keys):
        """Press keys where the focus is."""
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def wait(self, condition, seconds=10.0):
        """Wait until something is so, and return it; what the page replaces meanwhile is looked for again."""
        from selenium.common.exceptions import NoSuchElementException, StaleElementReferenceException
        from selenium.webdriver.support.ui import WebDriverWait

        passing = (NoSuchElementException, StaleElementReferenceException)
        return WebDriverWait(self.driver, seconds, 0.05, passing).until(lambda _: condition())

    def column(self, section, place):
        """Return the cells of a column of a section's table as text, from above."""
        return [
            row.find_elements("css selector", "th, td")[place].text for row in self.find_all(f"#{section} tbody tr")
        ]

    def complaints(self):
        """Return what the browser's console says of errors and warnings."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
