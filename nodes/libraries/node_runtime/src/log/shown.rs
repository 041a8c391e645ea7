//! Log lines as the console shows them: nothing of what comes from outside commands the terminal.

use std::io::{Result, Write};

use metrology::visible::visible;

/// What begins a colour. The formatter of lines writes out those of messages itself, so what arrives here is its own.
const ESCAPE: &str = "\u{1b}";

/// A console that lines are written to whole.
pub(super) struct Shown<W>(pub W);

impl<W: Write> Write for Shown<W> {
    fn write(&mut self, line: &[u8]) -> Result<usize> {
        let text = String::from_utf8_lossy(line);
        let (words, end) = match text.strip_suffix('\n') {
            Some(words) => (words, "\n"),
            None => (&*text, ""),
        };
        let pieces: Vec<_> = words.split(ESCAPE).map(visible).collect();
        // A second line within a text from outside would pass for one of the program's.
        let words = pieces.join(ESCAPE).replace('\n', "\\n");
        self.0.write_all((words + end).as_bytes())?;
        Ok(line.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};

    use tracing_subscriber::fmt;
    use tracing_subscriber::layer::SubscriberExt as _;

    use super::*;

    /// What a line is on a console with colours.
    fn console(say: impl FnOnce()) -> String {
        let kept = Arc::new(Mutex::new(Vec::new()));
        let writer = {
            let kept = Arc::clone(&kept);
            move || Shown(Kept(Arc::clone(&kept)))
        };
        let layer = fmt::layer().with_writer(writer).with_ansi(true);
        tracing::subscriber::with_default(tracing_subscriber::registry().with(layer), say);
        let bytes = kept.lock().unwrap().clone();
        String::from_utf8(bytes).unwrap()
    }

    struct Kept(Arc<Mutex<Vec<u8>>>);

    impl Write for Kept {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            self.0.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn an_alarm_text_commands_no_terminal_and_colours_of_the_line_stay() {
        let text = "spindle \u{1b}[2J\u{9b}2J\u{202e}hot\r\nERROR invented";
        let line = console(|| tracing::error!(condition = text, "{text}"));
        let coloured = line.replace("\u{1b}[", "");
        assert!(coloured.len() < line.len(), "{line:?}");
        assert!(!line.contains("\u{1b}[2J"), "{line:?}");
        let unseen = coloured.contains(metrology::visible::is_unseen);
        assert!(!unseen, "{line:?}");
        assert_eq!(line.lines().count(), 1, "{line:?}");
    }
}
