//! A run whose page or figures could not be written, as on a full disk: the file that failed, and the files that are whole.

use std::fmt;
use std::path::Path;
use std::process::ExitCode;

use node_runtime::complain;

/// The file that could not be written, and the files that are whole.
pub struct Unwritten<'r> {
    /// Why, with the path of the file.
    pub error: anyhow::Error,
    /// Whether the plan ran to its end.
    pub is_plan_whole: bool,
    /// The bag, where messages were recorded.
    pub bag: Option<&'r Path>,
    /// The page, where it was written whole.
    pub page: Option<&'r Path>,
}

impl Unwritten<'_> {
    /// Prints it; the exit code.
    pub fn complain(&self) -> ExitCode {
        complain!("abbe: {self}");
        ExitCode::FAILURE
    }
}

impl fmt::Display for Unwritten<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "not written: {:#}", self.error)?;
        if self.is_plan_whole {
            f.write_str("; the plan ran to its end")?;
        }
        match self.page {
            Some(page) => write!(f, "; the page {} is whole", page.display())?,
            None => f.write_str("; no page was written, its contents are above")?,
        }
        match self.bag {
            Some(bag) => write!(
                f,
                ": make room, and write both again by `abbe report {} --out FOLDER`",
                bag.display()
            ),
            None => f.write_str(": make room, and run it again"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_failed_and_what_is_there_are_both_named() {
        let of = |file: &str, is_plan_whole: bool, bag: Option<&str>, page: Option<&str>| {
            let unwritten = Unwritten {
                error: anyhow::anyhow!("report: r/{file}: No space left on device"),
                is_plan_whole,
                bag: bag.map(Path::new),
                page: page.map(Path::new),
            };
            unwritten.to_string()
        };
        let figures = of("report.json", true, Some("r/bag"), Some("r/report.html"));
        assert_eq!(
            figures,
            "not written: report: r/report.json: No space left on device; the plan ran to its end; the page \
             r/report.html is whole: make room, and write both again by `abbe report r/bag --out FOLDER`"
        );
        let page = of("report.html", true, Some("r/bag"), None);
        assert!(page.contains("r/report.html: No space") && page.contains("no page was written"));
        assert!(page.contains("the plan ran to its end"), "{page}");
        let failed = of("report.html", false, None, None);
        assert!(!failed.contains("to its end"), "{failed}");
        assert!(failed.ends_with("make room, and run it again"), "{failed}");
        let half = of("report.json", false, Some("b"), Some("p"));
        assert!(half.contains("the page p is whole") && !half.contains("to its end"));
    }
}
