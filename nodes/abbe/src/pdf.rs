//! A page as a PDF of A4 sheets, printed by headless Chromium: `--pdf FILE` of `report` and `diagnose`.
//!
//! Each sheet has machine, operator and instruments with their certificates at its head, and page numbers at its foot. The
//! browser gets a folder of its own for profile and page, at most a minute, and is ended by the number of its process.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use nix::unistd::geteuid;
use reports::evaluate::budget::NOT_STATED;
use reports::whole_file::{self, Helpers, Vanishing};
use serde_json::Value;

/// Names of the program, the first that is there is taken.
const BROWSERS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome-stable",
    "google-chrome",
];
/// Arguments that keep it off network, desktop and the user's own profile; our style has its own head and foot.
const ALONE: [&str; 8] = [
    "--headless",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--no-pdf-header-footer",
];
/// Longest time that it may take.
const LONGEST: Duration = Duration::from_secs(60);
/// How often it is looked at.
const BETWEEN_LOOKS: Duration = Duration::from_millis(50);
/// Most letters of its messages that an error has.
const MOST_MESSAGE: usize = 300;
/// Most bytes of its messages that are read.
const MOST_MESSAGES: u64 = 1 << 20;
/// Most bytes of a PDF.
const MOST_BYTES: u64 = 256 << 20;

/// The head of each sheet.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// Name of the machine.
    pub machine: Option<String>,
    /// Who measured.
    pub operator: Option<String>,
    /// Instruments, each with serial number and certificate.
    pub instruments: Vec<String>,
}

impl Head {
    /// From the name of the machine and the conditions of a report's figures.
    pub fn of(machine: Option<&str>, conditions: &Value) -> Self {
        let instruments = conditions["instruments"].as_array().into_iter().flatten();
        Self {
            machine: machine.map(str::to_owned),
            operator: conditions["operator"].as_str().map(str::to_owned),
            instruments: instruments.map(instrument).collect(),
        }
    }

    /// The style of a printed page.
    fn style(&self) -> String {
        let stated = |text: &Option<String>| text.clone().unwrap_or_else(|| NOT_STATED.to_owned());
        let left = format!(
            "Machine: {}\nOperator: {}",
            stated(&self.machine),
            stated(&self.operator)
        );
        let right = if self.instruments.is_empty() {
            format!("Instruments: {NOT_STATED}")
        } else {
            self.instruments.join("\n")
        };
        format!(
            "<style>@page {{ size: A4; margin: 26mm 14mm 18mm;
@top-left {{ content: {}; {SMALL} text-align: left; width: 45%; }}
@top-right {{ content: {}; {SMALL} text-align: right; width: 55%; }}
@bottom-right {{ content: \"Page \" counter(page) \" of \" counter(pages); {SMALL} }} }}
@media print {{ h1, h2, h3 {{ break-after: avoid; }} figure, tr, svg {{ break-inside: avoid; }} thead {{ display: table-header-group; }} }}</style>",
            css_text(&left),
            css_text(&right)
        )
    }
}

/// Letters of head and foot.
const SMALL: &str = "white-space: pre-wrap; font: 7.5pt sans-serif; color: #333333;";

/// An instrument in a line.
fn instrument(entry: &Value) -> String {
    let kind = entry["kind"].as_str().unwrap_or_default().replace('_', " ");
    let of = |key: &str| entry[key].as_str().unwrap_or(NOT_STATED);
    format!(
        "{kind}: {}, serial number {}, certificate {}",
        of("instrument"),
        of("serial_number"),
        of("certificate")
    )
}

/// A text as a string of CSS within a style element: everything but letters, digits and plain marks as its number.
fn css_text(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || " .,:;()-_+/".contains(c);
    let of = |c: char| {
        if is_plain(c) {
            c.to_string()
        } else {
            format!("\\{:x} ", u32::from(c))
        }
    };
    format!("\"{}\"", text.chars().map(of).collect::<String>())
}

/// Writes a page as a PDF in the place of an old one.
///
/// # Errors
/// Without Chromium, when it fails or takes too long, or when the file cannot be written.
pub fn write(path: &Path, page: &str, head: &Head) -> Result<()> {
    let browser = BROWSERS.into_iter().find_map(on_path);
    let Some(browser) = browser else {
        bail!(
            "--pdf {}: no {} on PATH, which prints the page: install one (Debian: `apt install chromium`), or print the HTML page from any browser",
            path.display(),
            BROWSERS.join(", ")
        );
    };
    let bytes = print(Command::new(browser), page, head, LONGEST)
        .with_context(|| format!("--pdf {}", path.display()))?;
    whole_file::write_bytes(path, &bytes)
}

/// The first program of this name on PATH.
fn on_path(name: &str) -> Option<PathBuf> {
    let folders = std::env::var_os("PATH")?;
    let mut all = std::env::split_paths(&folders).map(|folder| folder.join(name));
    all.find(|program| program.is_file())
}

/// The page as a browser prints it.
fn print(mut browser: Command, page: &str, head: &Head, longest: Duration) -> Result<Vec<u8>> {
    let name = browser.get_program().to_string_lossy().into_owned();
    let home = Vanishing::temporary().context("folder for the browser")?;
    let file = |name: &str| home.path().join(name);
    let styled = unfolded(page).replacen("</head>", &format!("{}</head>", head.style()), 1);
    std::fs::write(file("page.html"), styled).context("page for the browser")?;
    let messages = File::create(file("messages")).context("messages of the browser")?;
    browser
        .args(ALONE)
        // Chromium refuses its sandbox to root; the page is our own and runs no script.
        .args(geteuid().is_root().then_some("--no-sandbox"))
        .arg(format!("--user-data-dir={}", file("profile").display()))
        .arg(format!("--print-to-pdf={}", file("page.pdf").display()))
        .arg(format!("file://{}", file("page.html").display()))
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(messages);
    let browser = Helpers::start(&mut browser).with_context(|| name.clone())?;
    let status = wait(browser, longest, &name)?;
    let reason = || last_message(&file("messages"));
    if !status.success() {
        bail!("{name} ended with {status}: {}", reason());
    }
    let pdf = file("page.pdf");
    let size = std::fs::metadata(&pdf).map_or(0, |it| it.len());
    if size == 0 || size > MOST_BYTES {
        bail!(
            "{name} wrote {size} bytes, must be 1 to {MOST_BYTES}: {}",
            reason()
        );
    }
    let bytes = std::fs::read(&pdf).context("the browser's PDF")?;
    if !bytes.starts_with(b"%PDF-") {
        bail!("{name} wrote no PDF: {}", reason());
    }
    Ok(bytes)
}

/// Paper has nothing to fold: every part stands open, as a section whose head stays with what follows it. A browser keeps the
/// summary of a `details` apart from its content at the foot of a sheet.
fn unfolded(page: &str) -> String {
    let parts = page
        .replace("<details", "<section")
        .replace("</details>", "</section>");
    parts
        .replace("<summary>", "<div class=\"summary\">")
        .replace("</summary>", "</div>")
}

/// Waits for the end of a process; one that takes too long is killed with its group. Helpers of its own may outlive it, and
/// are killed too.
fn wait(
    (mut child, helpers): (Child, Helpers),
    longest: Duration,
    name: &str,
) -> Result<std::process::ExitStatus> {
    let until = Instant::now() + longest;
    loop {
        if let Some(status) = child.try_wait().context("the browser")? {
            return Ok(status);
        }
        if Instant::now() >= until {
            drop(helpers);
            child.wait().context("the browser")?;
            bail!(
                "{name} took more than {} s and was ended: print the HTML page from any browser",
                longest.as_secs()
            );
        }
        std::thread::sleep(BETWEEN_LOOKS);
    }
}

/// The last line of the begin of a file of messages.
fn last_message(path: &Path) -> String {
    let mut bytes = Vec::new();
    if let Ok(file) = File::open(path) {
        // What cannot be read is no message.
        let _ = file.take(MOST_MESSAGES).read_to_end(&mut bytes);
    }
    let text = String::from_utf8_lossy(&bytes);
    let line = text.lines().rfind(|line| !line.trim().is_empty());
    let line = line.unwrap_or("no message");
    line.chars().take(MOST_MESSAGE).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = "<!DOCTYPE html><html><head><title>t</title></head><body>text</body></html>";

    /// Prints with a shell script as the browser.
    fn printed(text: &str, longest: Duration) -> Result<Vec<u8>> {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("browser");
        std::fs::write(&path, format!("{text}\n")).unwrap();
        let mut shell = Command::new("sh");
        shell.arg(path);
        print(shell, PAGE, &Head::default(), longest)
    }

    /// The argument behind `--print-to-pdf=`, for scripts.
    const TARGET: &str = "for a in \"$@\"; do case $a in --print-to-pdf=*) f=${a#*=};; esac; done";

    #[test]
    fn the_browsers_file_is_taken_if_it_is_a_pdf() {
        let long = Duration::from_secs(20);
        let good = printed(&format!("{TARGET}; echo '%PDF-1.4 x' > \"$f\""), long);
        assert_eq!(good.unwrap(), b"%PDF-1.4 x\n");
        for (text, words) in [
            (format!("{TARGET}; echo text > \"$f\""), "wrote no PDF"),
            ("exit 0".to_owned(), "wrote 0 bytes"),
            (
                "echo broken >&2; exit 3".to_owned(),
                "exit status: 3: broken",
            ),
        ] {
            let error = format!("{:#}", printed(&text, long).unwrap_err());
            assert!(error.contains(words), "{error}");
        }
    }

    #[test]
    fn a_part_stands_open_and_its_head_stays_with_it() {
        let page = "<details class=\"part\"><summary><h2>Causes</h2></summary><p>x</p></details>";
        assert_eq!(
            unfolded(page),
            "<section class=\"part\"><div class=\"summary\"><h2>Causes</h2></div><p>x</p></section>"
        );
    }

    #[test]
    fn a_browser_that_hangs_is_ended() {
        let error = printed("sleep 1000 & sleep 1000", Duration::from_millis(200)).unwrap_err();
        assert!(error.to_string().contains("and was ended"), "{error}");
    }

    #[test]
    fn no_text_of_a_budget_leaves_its_string() {
        assert_eq!(
            css_text("A. B.\n\"</style>"),
            "\"A. B.\\a \\22 \\3c /style\\3e \""
        );
        let conditions = serde_json::json!({
            "operator": "\"; } body { display: none",
            "instruments": [{"kind": "length_reference", "instrument": "Laser", "serial_number": "12-3", "certificate": "K 7 of 2026-01-02"}],
        });
        let head = Head::of(Some("vmc"), &conditions);
        let style = head.style();
        assert_eq!(style.matches('{').count(), style.matches('}').count());
        assert!(!style.contains("} body"), "{style}");
        assert_eq!(
            head.instruments,
            ["length reference: Laser, serial number 12-3, certificate K 7 of 2026-01-02"]
        );
        assert!(style.contains("certificate K 7 of 2026-01-02"), "{style}");
    }
}
