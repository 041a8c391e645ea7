//! Pages as a reader sees them: headless Chromium, for their widths, pictures and print.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// What keeps it from looking for a network that is not there; bars lie over a page, as on a phone.
const ALONE: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
];
/// Its windows are never narrower than 500 px: a page is framed to be seen on a phone.
const FRAME: &str = "\
<!DOCTYPE html><html><head><meta charset=\"utf-8\"><title>none</title><style>body { margin: 0 } iframe { border: 0; display: block }</style></head><body>
<iframe src=\"page.html\" style=\"width: WIDTHpx; height: HEIGHTpx\"></iframe>
<script>addEventListener('message', (told) => { document.title = JSON.stringify(told.data); });</script>
</body></html>
";
/// Says how wide a page is, and what of it lies beyond its right edge; what scrolls for itself may.
const RULER: &str = "\
<script>addEventListener('load', () => {
  const page = document.documentElement;
  const scrolls = (e) => e && (getComputedStyle(e).overflowX === 'auto' || scrolls(e.parentElement));
  const beyond = [...document.body.querySelectorAll('*')].filter((e) => !scrolls(e) && e.getBoundingClientRect().right > page.clientWidth + 0.5);
  parent.postMessage({ seen_px: page.clientWidth, needed_px: page.scrollWidth, height_px: page.scrollHeight,
    beyond: beyond.slice(0, 5).map((e) => e.tagName + ' ' + e.textContent.slice(0, 40)) }, '*');
});</script>
</body>";

/// Says of each picture its first colour and how much of it has another.
const EYE: &str = "\
<!DOCTYPE html><html><head><title>none</title></head><body>PICTURES
<script>addEventListener('load', () => {
  const seen = [...document.images].map((image) => {
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [WIDTH, image.naturalHeight];
    const context = canvas.getContext('2d');
    context.drawImage(image, 0, 0);
    const bytes = context.getImageData(0, 0, canvas.width, canvas.height).data;
    const other = (k) => [0, 1, 2].some((c) => bytes[k + c] !== bytes[c]);
    let inked = 0;
    for (let k = 0; k < bytes.length; k += 4) inked += other(k);
    return { paper: [...bytes.slice(0, 3)], inked: inked / (bytes.length / 4) };
  });
  document.title = JSON.stringify(seen);
});</script></body></html>
";

/// How a page lies in a window.
#[derive(Debug)]
pub struct Layout {
    /// Width that is seen, px.
    pub seen_px: f64,
    /// Width that the page takes, px.
    pub needed_px: f64,
    /// Height that the page takes, px.
    pub height_px: f64,
    /// Elements beyond the right edge, the first few.
    pub beyond: Vec<String>,
}

/// A picture of a page.
#[derive(Debug)]
pub struct Picture {
    /// Colour of its first pixel: red, green, blue, 0 to 255.
    pub paper: [f64; 3],
    /// Share of its pixels that have another colour than the first.
    pub inked: f64,
}

/// Whether Chromium can be started; where it cannot, the test's name and the reason are printed.
///
/// # Panics
/// When it cannot and `CI=true`.
#[must_use]
pub fn is_there(test: &str) -> bool {
    let asked = Command::new("chromium").arg("--version").output();
    let is_there = asked.is_ok_and(|said| said.status.success());
    if !is_there {
        let reason = "chromium cannot be started (tests/run installs it)";
        assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
        eprintln!("NOT TESTED: {test}: {reason}");
    }
    is_there
}

/// A browser that looks at one page.
pub struct Browser {
    home: TempDir,
}

impl Browser {
    /// One for a page as a file, its text given; pictures lie beside it until this is dropped.
    ///
    /// Where there is no Chromium the test's name and the reason are printed, and `None` tells the test to end.
    ///
    /// # Panics
    /// When there is none and `CI=true`.
    #[must_use]
    pub fn of(page: &str, test: &str) -> Option<Self> {
        if !is_there(test) {
            return None;
        }
        let home = tempfile::tempdir().unwrap();
        assert_eq!(page.matches("</body>").count(), 1, "a page has one body");
        std::fs::write(
            home.path().join("page.html"),
            page.replace("</body>", RULER),
        )
        .unwrap();
        Some(Self { home })
    }

    fn file(&self, name: &str) -> PathBuf {
        self.home.path().join(name)
    }

    /// Starts it with a profile of its own.
    fn opened(&self, more: &[String], url: &Path) -> Vec<u8> {
        let profile = tempfile::tempdir().unwrap();
        let mut chromium = Command::new("chromium");
        chromium
            .args(ALONE)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .args(more)
            .arg(format!("file://{}", url.display()))
            .stdin(Stdio::null());
        let output = chromium.output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{chromium:?}: {said}");
        output.stdout
    }

    fn framed(&self, width_px: u32, height_px: u32) -> PathBuf {
        let frame = FRAME
            .replace("WIDTH", &width_px.to_string())
            .replace("HEIGHT", &height_px.to_string());
        let path = self.file("frame.html");
        std::fs::write(&path, frame).unwrap();
        path
    }

    /// What a page of ours has written into its title.
    fn told_by(&self, more: &[&str], url: &Path) -> Value {
        let more: Vec<String> = more.iter().map(|&one| one.to_owned()).collect();
        let dom = self.opened(&[&["--dump-dom".to_owned()], &more[..]].concat(), url);
        let dom = String::from_utf8(dom).unwrap();
        let title = dom.split("<title>").nth(1).unwrap();
        let title = title.split("</title>").next().unwrap();
        let plain = title.replace("&lt;", "<").replace("&gt;", ">");
        serde_json::from_str(&plain.replace("&amp;", "&"))
            .unwrap_or_else(|error| panic!("{error}: {title}"))
    }

    /// How the page lies in a window of this width.
    ///
    /// # Panics
    /// When the browser does not end well, or the page says nothing.
    #[must_use]
    pub fn layout(&self, width_px: u32) -> Layout {
        let told = self.told_by(&[], &self.framed(width_px, 800));
        let number = |key: &str| told[key].as_f64().unwrap();
        let beyond = told["beyond"].as_array().unwrap().iter();
        Layout {
            seen_px: number("seen_px"),
            needed_px: number("needed_px"),
            height_px: number("height_px"),
            beyond: beyond.map(|e| e.as_str().unwrap().to_owned()).collect(),
        }
    }

    /// Pictures of the whole page at this width and height, in light and in dark.
    ///
    /// # Panics
    /// When the browser does not end well, or makes no picture.
    #[must_use]
    pub fn pictures(&self, (width_px, height_px): (u32, u32)) -> [Picture; 2] {
        let frame = self.framed(width_px, height_px);
        let names = ["dark", "light"].map(|scheme| format!("{width_px}_{scheme}.png"));
        for (scheme, name) in names.iter().enumerate() {
            let more = [
                format!("--screenshot={}", self.file(name).display()),
                format!("--window-size={width_px},{height_px}"),
                format!("--blink-settings=preferredColorScheme={scheme}"),
            ];
            self.opened(&more, &frame);
        }
        let images = names.map(|name| format!("<img src=\"{name}\">")).concat();
        let eye = EYE
            .replace("PICTURES", &images)
            .replace("WIDTH", &width_px.to_string());
        let path = self.file("eye.html");
        std::fs::write(&path, eye).unwrap();
        let seen = self.told_by(&["--allow-file-access-from-files"], &path);
        [1, 0].map(|k| Picture {
            paper: [0, 1, 2].map(|c| seen[k]["paper"][c].as_f64().unwrap()),
            inked: seen[k]["inked"].as_f64().unwrap(),
        })
    }

    /// The page as a PDF, as it is printed.
    ///
    /// # Panics
    /// When the browser does not end well, or makes none.
    #[must_use]
    pub fn print(&self) -> Vec<u8> {
        let path = self.file("page.pdf");
        let more = [format!("--print-to-pdf={}", path.display())];
        self.opened(&more, &self.file("page.html"));
        std::fs::read(path).unwrap()
    }
}
