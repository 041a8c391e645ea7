//! Files that programs of instruments write in forms of their own, known by their content.
//!
//! A reader makes a table of such a file, whose columns are recognised like those of any other. What is known of each form, and
//! from where, is in its reader's head. A form whose readings nobody has described in public is refused with the way out.

use anyhow::{Context, Result, bail};

use super::bare_touches;
use super::probe_log;
use super::renishaw_laser;
use super::sheet::Cells;

/// Bytes from the begin of a file by which its form is known.
const BYTES_LOOKED_AT: usize = 256 << 10;

/// Lists of touches of controls.
const LINUXCNC_LIST: &str = "list of touches by LinuxCNC (PROBEOPEN)";
const LETTERED_LIST: &str = "list of touches, letters with numbers (DPRNT, FN 16)";

/// A form of files.
pub struct Instrument {
    /// What writes it, for messages.
    pub name: &'static str,
    /// Whether the begin of a text is of this form.
    is_one: fn(&str) -> bool,
    content: Content,
}

/// What can be had of a form.
enum Content {
    /// A table.
    Table(fn(&str) -> Result<Cells>),
    /// Nothing, with the reason and the way out.
    Refused(&'static str),
}

/// The forms that are known, one a line.
static INSTRUMENTS: [Instrument; 7] = [
    Instrument {
        name: LINUXCNC_LIST,
        is_one: probe_log::is_linuxcnc,
        content: Content::Table(probe_log::linuxcnc),
    },
    Instrument {
        name: LETTERED_LIST,
        is_one: probe_log::is_lettered,
        content: Content::Table(probe_log::lettered),
    },
    Instrument {
        name: "list of touches without names",
        is_one: bare_touches::is_one,
        content: Content::Table(bare_touches::cells),
    },
    Instrument {
        name: "Renishaw laser file (rtl, rta)",
        is_one: renishaw_laser::is_one,
        content: Content::Table(renishaw_laser::cells),
    },
    Instrument {
        name: "Renishaw dynamic capture (rtx)",
        is_one: renishaw_laser::is_dynamic,
        content: Content::Refused(
            "readings at a high rate, without targets: measure at stops and save a linear or rotary run (rtl, rta)",
        ),
    },
    Instrument {
        name: "Renishaw ballbar file (b5r)",
        is_one: is_ballbar,
        content: Content::Refused(
            "where its XML has the readings is not described in public: export angle and radial deviation as CSV",
        ),
    },
    Instrument {
        name: "API laser file (pos)",
        is_one: |text| text.contains("Bidirectional Avg Error"),
        content: Content::Refused(
            "only its means are described in public, and not their sign: export target, deviation and direction of every reading as CSV",
        ),
    },
];

/// The XML of Ballbar 20: elements MACHINE_TESTED and PLANE, figures such as AF_CIRCULARITY.
fn is_ballbar(text: &str) -> bool {
    let marks = ["<MACHINE_TESTED", "TEST_PLANE=", "\"AF_CIRCULARITY\""];
    text.trim_start().starts_with('<') && marks.into_iter().any(|mark| text.contains(mark))
}

/// The form that a file is of; none of those that are known.
pub fn of(bytes: &[u8]) -> Option<&'static Instrument> {
    let begin = bytes.get(..BYTES_LOOKED_AT).unwrap_or(bytes);
    let text = text_of(begin);
    INSTRUMENTS.iter().find(|form| (form.is_one)(&text))
}

/// The text of a file: names of machines may be in any encoding, and numbers are ASCII. Of UTF-16 with a byte order mark the
/// letters, and lines that end as on any system.
fn text_of(bytes: &[u8]) -> String {
    let of_pairs = |order: fn([u8; 2]) -> u16| {
        let pairs = bytes[2..].as_chunks().0.iter().copied().map(order);
        String::from_utf16_lossy(&pairs.collect::<Vec<u16>>())
    };
    let text = match bytes {
        [0xff, 0xfe, ..] => of_pairs(u16::from_le_bytes),
        [0xfe, 0xff, ..] => of_pairs(u16::from_be_bytes),
        _ => String::from_utf8_lossy(bytes).into_owned(),
    };
    let text = text.trim_start_matches('\u{feff}');
    if text.contains('\n') {
        text.to_owned()
    } else {
        text.replace('\r', "\n")
    }
}

impl Instrument {
    /// The table that a file holds, with `decimal` before decimals.
    ///
    /// # Errors
    /// Names the line that is damaged; or that such a file cannot be read.
    pub fn cells(&self, bytes: &[u8], decimal: char) -> Result<Cells> {
        let read = match self.content {
            Content::Table(read) => read,
            Content::Refused(why) => bail!("{}: {why}", self.name),
        };
        let mut cells = read(&text_of(bytes)).with_context(|| self.name)?;
        if decimal != '.' {
            let numbers = cells
                .sheet
                .lines
                .iter_mut()
                .skip(1)
                .flat_map(|(_, cells)| cells);
            numbers.for_each(|cell| *cell = cell.replace('.', &decimal.to_string()));
        }
        cells.form = Some(self.name);
        Ok(cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_are_known_by_their_content() {
        for (text, name) in [
            (
                "HEADER::\r\nFile type  : rtl\r\n\r\nTARGET DATA::\r\n",
                Some("laser file (rtl"),
            ),
            ("\u{feff}HEADER::\nTARGET DATA::\n", Some("laser file (rtl")),
            (
                "HEADER::\r\nOwner: CARTO-Dynamic\r\nData:\r\n",
                Some("(rtx)"),
            ),
            (
                "<?xml version=\"1.0\"?><TEST><PLANE TEST_PLANE=\"XY\"/></TEST>",
                Some("(b5r)"),
            ),
            (
                "Position   \tBidirectional Avg Error\n0.0 0.001\n",
                Some("API"),
            ),
            ("<?xml version=\"1.0\"?><html/>", None),
            ("run,target_mm,deviation_um\n1,0,0.5\n", None),
            ("HEADER\n1,2\n", None),
            ("", None),
        ] {
            let found = of(text.as_bytes()).map(|form| form.name);
            match name {
                Some(words) => assert!(found.is_some_and(|name| name.contains(words)), "{text}"),
                None => assert_eq!(found, None, "{text}"),
            }
        }
    }

    #[test]
    fn forms_without_a_public_description_are_refused_with_the_way_out() {
        for (text, words) in [
            (
                "<R><MACHINE_TESTED NAME=\"m\"/></R>",
                "export angle and radial deviation as CSV",
            ),
            ("HEADER::\nData:\n\0\0", "measure at stops"),
            (
                "Position \tBidirectional Avg Error\n",
                "of every reading as CSV",
            ),
        ] {
            let form = of(text.as_bytes()).expect(text);
            let said = form.cells(text.as_bytes(), '.').unwrap_err().to_string();
            assert!(
                said.starts_with(form.name) && said.contains(words),
                "{said}"
            );
        }
    }

    #[test]
    fn no_bytes_make_it_fail_and_a_long_file_is_looked_at_from_its_begin() {
        let mut long = vec![0xFF; BYTES_LOOKED_AT + 7];
        assert!(of(&long).is_none());
        long.extend(b"HEADER::\nTARGET DATA::\n");
        assert!(of(&long).is_none());
        for bytes in [
            &b"\xFF\xFEHEADER::"[..],
            b"<",
            b"HEADER::",
            b"HEADER::\xFF\nData:",
        ] {
            let read = of(bytes).map(|form| form.cells(bytes, '.').is_ok());
            assert_ne!(read, Some(true), "{bytes:?}");
        }
    }
}
