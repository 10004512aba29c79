"""A headless Chromium that looks at pages of the site; it is found, with its driver, by its name."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
PHONE, DESK = (390, 844), (1280, 1000)


class Browser:
    """A headless Chromium that looks at pages of the site from the disk."""

    def __init__(self, driver: Any, folder: Path) -> None:
        self.driver, self.folder = driver, folder

    def emulate(self, size: tuple[int, int] = DESK, **media: str) -> None:
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": size == PHONE}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        features = [{"name": name.replace("_", "-"), "value": value} for name, value in media.items()]
        self.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})

    def open(self, page: str) -> None:
        self.driver.get("about:blank")
        self.driver.get(f"{self.folder.as_uri()}/{page}")
        # A large page may not be there yet on a busy machine.
        self.until("location.protocol === 'file:' && document.readyState === 'complete'")

    def run(self, script: str, *values: Any) -> Any:
        return self.driver.execute_script(script, *values)

    def until(self, script: str) -> None:
        from selenium.webdriver.support.ui import WebDriverWait

        WebDriverWait(self.driver, 60).until(lambda driver: driver.execute_script(f"return {script}"), script)

    def press(self, *keys: str) -> None:
        from selenium.webdriver import ActionChains

        ActionChains(self.driver).send_keys(*keys).perform()

    def choose(self, label: str, value: str) -> None:
        self.run(
            "const lists = [...document.querySelectorAll('.fx-list')];"
            "const own = lists.find(one => one.textContent.startsWith(arguments[0]));"
            "const list = own.querySelector('select'); list.value = arguments[1];"
            "list.dispatchEvent(new Event('change'))",
            label,
            value,
        )

    def complaints(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


@contextmanager
def chromium_at(folder: Path, profile: Path) -> Iterator[Browser]:
    """Open a browser on the built site, or skip the test where there is none; `profile`: empty, its own files'."""
    webdriver = pytest.importorskip("selenium.webdriver", reason="selenium comes with the extra `test`")
    program = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if program is None or driver is None:
        pytest.skip("no chromium with chromedriver here: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = program
    for flag in (*FLAGS, f"--user-data-dir={profile}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    try:
        yield Browser(opened, folder)
    finally:
        opened.quit()
