"""How large a page of `record --html` is, and how fast a browser plays it.

    python tools/benchmarks/benchmark_html.py scenes/ring.yaml --duration 10
    python tools/benchmarks/benchmark_html.py ring.html

Headless Chromium draws without a graphics card (SwiftShader), on the cores that run everything else, which is as slow as it
gets. Playing: frames shown in a second of real time while the page plays at 1×. Drawing: frames a second as fast as they can
be drawn, each waited for by reading a pixel of it back; medians of a few rounds. The processor time is that of the whole
browser, and depends little on what else runs.
"""

import argparse
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

from headless_browser import BrowserError, HeadlessBrowser

# Frames shown while the page plays for so many seconds, from the first picture on.
PLAYING = """(async (seconds) => {
  const picture = () => new Promise(requestAnimationFrame);
  player.go(0);
  player.play();
  const began = await picture(), shown = player.shownCount;
  let now = began;
  while (now - began < 1000 * seconds) now = await picture();
  player.play(false);
  return 1000 * (player.shownCount - shown) / (now - began);
})(%g)"""
# Seconds for each of so many frames, drawn one after the other.
DRAWING = """((count) => {
  const { gl } = player.drawing, pixel = new Uint8Array(4), began = performance.now();
  for (let k = 0; k < count; k++) {
    player.go(k * player.run.frameCount / count);
    player.draw();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  }
  return (performance.now() - began) / 1000 / count;
})(%d)"""
UNPACKING = """(async () => {
  const began = performance.now();
  await Run.unpack(JSON.parse(element("header").textContent), element("block").textContent);
  return (performance.now() - began) / 1000;
})()"""
DRIVER = """(() => {
  const { gl } = player.drawing, known = gl.getExtension("WEBGL_debug_renderer_info");
  return known ? gl.getParameter(known.UNMASKED_RENDERER_WEBGL) : gl.getParameter(gl.RENDERER);
})()"""


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", help="a scene, or a page that was recorded")
    parser.add_argument("--duration", type=float, default=10.0, help="seconds of film, of a scene")
    parser.add_argument("--fps", type=float, default=30.0, help="frames a second, of a scene")
    parser.add_argument("--size", default="1280x720", help="of the window, in points")
    parser.add_argument("--seconds", type=float, default=5.0, help="of playing, for each round")
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    width, height = (int(side) for side in arguments.size.split("x"))
    with tempfile.TemporaryDirectory() as folder:
        page = Path(arguments.what)
        if page.suffix != ".html":
            page = Path(folder) / "page.html"
            command = [sys.executable, "-m", "mpp_taichi", "record", arguments.what, "--html", str(page), "--quiet"]
            subprocess.run([*command, "--duration", str(arguments.duration), "--fps", str(arguments.fps)], check=True)
        try:
            with HeadlessBrowser((width, height)) as browser:
                _measure(browser, page, arguments)
        except BrowserError as error:
            print(f"error: {error}", file=sys.stderr)
            return 3
    return 0


def _measure(browser: HeadlessBrowser, page: Path, arguments: argparse.Namespace) -> None:
    browser.open(page)
    browser.settle()
    run = browser.evaluate("({ frames: player.run.frameCount, particles: player.run.count, fps: player.run.header.fps })")
    print(f"page       {page.stat().st_size / 1e6:.2f} MB: {run['frames']} frames of {run['particles']} particles")
    print(f"driver     {browser.evaluate(DRIVER)}, {arguments.size}")
    unpacking = [browser.evaluate(UNPACKING) for _ in range(arguments.rounds)]
    print(f"unpacking  {statistics.median(unpacking):.3f} s")
    playing, spent = [], []
    for _ in range(arguments.rounds):
        before = browser.processor_seconds()
        playing.append(browser.evaluate(PLAYING % arguments.seconds))
        spent.append((browser.processor_seconds() - before) / (playing[-1] * arguments.seconds))
    each = ", ".join(f"{rate:.1f}" for rate in playing)
    print(f"playing    {statistics.median(playing):.1f} frames/s of {run['fps']:g} asked for ({each})")
    print(f"           {1000 * statistics.median(spent):.0f} ms of processor time for each, on all cores together")
    drawing = [1.0 / browser.evaluate(DRAWING % min(100, run["frames"])) for _ in range(arguments.rounds)]
    print(f"drawing    {statistics.median(drawing):.1f} frames/s at most ({', '.join(f'{rate:.1f}' for rate in drawing)})")


if __name__ == "__main__":
    sys.exit(main())
