//! The first screen of a page: what was measured, where and when, a verdict, a few tiles and one picture.
//!
//! A person decides from it within seconds; everything else folds below it. Parts of a page each bring a screen of their own,
//! which [`Screen::join`] makes one of: the first verdict and the first picture stay.

use chrono::DateTime;
use maud::{Markup, html};
use recorder::{Bag, RecordedRun};
use replayer::machines;
use serde_json::{Value, json};

use crate::machine_of_bag;
use crate::section::capitalised;

/// Most tiles.
const MOST_TILES: usize = 5;
/// Most letters of a tile's remark; the whole stands below.
const MOST_LETTERS_OF_TILE: usize = 200;
/// Digits of a commit that people compare.
const COMMIT_DIGITS: usize = 10;
/// A time before 1971 is that of a table whose begin nobody stated, s since 1970.
const FIRST_DATED_NANOS: i64 = 365 * 86_400 * 1_000_000_000;
/// What stands where a bag does not know.
const NOT_STATED: &str = "not stated";

/// How a verdict or a tile is meant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tone {
    /// All is well.
    Good,
    /// Something failed or is missing.
    Bad,
    /// A figure that nobody judges.
    #[default]
    Plain,
}

impl Tone {
    const fn class(self) -> Option<&'static str> {
        match self {
            Self::Good => Some("good"),
            Self::Bad => Some("bad"),
            Self::Plain => None,
        }
    }
}

/// One number with its name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tile {
    /// Such as `largest cause`.
    pub name: String,
    /// Such as `backlash X, 4.1 ± 0.2 µm`.
    pub value: String,
    /// A remark below it.
    pub more: String,
    /// How it is meant.
    pub tone: Tone,
}

impl Tile {
    /// A tile that nobody judges.
    #[must_use]
    pub fn new(name: &str, value: impl Into<String>, more: impl Into<String>) -> Self {
        Self {
            name: name.to_owned(),
            value: value.into(),
            more: more.into(),
            tone: Tone::Plain,
        }
    }

    /// The same meant as good or bad.
    #[must_use]
    pub fn toned(self, tone: Tone) -> Self {
        Self { tone, ..self }
    }

    fn html(&self) -> Markup {
        html! {
            div.tile {
                div.name { (self.name) }
                b class=[self.tone.class()] { (self.value) }
                @if !self.more.is_empty() { div.more { (shortened(&self.more)) } }
            }
        }
    }
}

/// A remark that a tile has room for.
fn shortened(text: &str) -> String {
    if text.chars().count() <= MOST_LETTERS_OF_TILE {
        return text.to_owned();
    }
    let begin: String = text.chars().take(MOST_LETTERS_OF_TILE).collect();
    let whole_words = begin
        .rsplit_once(' ')
        .map_or(begin.as_str(), |(words, _)| words);
    format!("{whole_words} …")
}

/// The program that made figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Software {
    /// Its version.
    pub version: &'static str,
    /// The commit that it was built from.
    pub commit: &'static str,
}

/// Where figures are from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Made {
    /// By what.
    pub software: Software,
    /// Name of the machine.
    pub machine: Option<String>,
    /// Namespaces of the bag's topics, without the root.
    pub namespaces: Vec<String>,
    /// Begin of the first test, ns since 1970 by the clock of the bag.
    pub begin_nanos: Option<i64>,
    /// End of the last test, ns since 1970.
    pub end_nanos: Option<i64>,
    /// Bag or table, as it was given.
    pub source: String,
    /// Commit of the software that recorded.
    pub recorded_by: Option<String>,
    /// Whether nothing was measured: the figures are foreseen, the begin is when that was done, and the source is a plan.
    pub is_foreseen: bool,
}

impl Made {
    /// From a bag by a program; `machine`: the name where the caller knows it better, `between`: begin and end of its tests, ns.
    #[must_use]
    pub fn of(
        software: Software,
        bag: &Bag,
        source: &str,
        machine: Option<&str>,
        between: Option<(i64, i64)>,
    ) -> Self {
        let run = RecordedRun::of(bag);
        let began = run.as_ref().map(|run| run.start_time_nanos);
        let began = began.and_then(|nanos| i64::try_from(nanos).ok());
        let commit = run
            .map(|run| run.commit)
            .filter(|commit| !commit.is_empty());
        Self {
            software,
            machine: machine.map(str::to_owned).or_else(|| machine_of(bag)),
            namespaces: { machines::namespaces(bag.topics()).into_iter() }
                .map(str::to_owned)
                .collect(),
            begin_nanos: between.map(|(begin, _)| begin).or(began),
            end_nanos: between.map(|(_, end)| end),
            source: source.to_owned(),
            recorded_by: commit,
            is_foreseen: false,
        }
    }

    /// Of figures that a program foresees of a plan for a machine, at `now_nanos`.
    #[must_use]
    pub fn of_plan(software: Software, machine: &str, source: &str, now_nanos: i64) -> Self {
        Self {
            software,
            machine: Some(machine.to_owned()),
            begin_nanos: Some(now_nanos),
            source: source.to_owned(),
            is_foreseen: true,
            ..Self::default()
        }
    }

    /// For machines: times as text in UTC, `null` where the bag does not know.
    #[must_use]
    pub fn as_json(&self) -> Value {
        json!({
            "machine": self.machine,
            "begin": self.begin_nanos.and_then(date),
            "end": self.end_nanos.and_then(date),
            "recorded_by_commit": self.recorded_by,
            "software": { "version": self.software.version, "commit": self.software.commit },
        })
    }

    fn when(&self) -> Option<String> {
        let begin = self.begin_nanos.and_then(date)?;
        Some(match self.end_nanos.and_then(date) {
            Some(end) if end != begin => format!("{begin} to {end}"),
            _ => begin,
        })
    }

    fn software(&self) -> String {
        let Software { version, commit } = self.software;
        let own = digits(commit);
        let recorder = match &self.recorded_by {
            Some(commit) if digits(commit) == own => String::new(),
            Some(commit) => format!("; recorded with {}", digits(commit)),
            None => String::new(),
        };
        format!("Abbe {version} ({own}){recorder}")
    }

    fn html(&self) -> Markup {
        let or_missing = |text: Option<String>| text.unwrap_or_else(|| NOT_STATED.to_owned());
        let (when, what) = if self.is_foreseen {
            ("Foreseen", "Plan")
        } else {
            ("Measured", "Data")
        };
        html! {
            dl.facts {
                dt { "Machine" } dd { (or_missing(self.machine.clone())) }
                @if !self.namespaces.is_empty() {
                    dt { "Namespace" } dd { (self.namespaces.join(", ")) }
                }
                dt { (when) } dd { (or_missing(self.when())) }
                dt { (what) } dd { (self.source) }
                dt { "Software" } dd { (self.software()) }
            }
        }
    }
}

/// The name in the machine file of a bag.
fn machine_of(bag: &Bag) -> Option<String> {
    let (machine, _) = machine_of_bag::of(bag).ok().flatten()?;
    Some(machine.name)
}

fn date(nanos: i64) -> Option<String> {
    let at = DateTime::from_timestamp_nanos(nanos);
    let is_known = nanos >= FIRST_DATED_NANOS;
    is_known.then(|| at.format("%Y-%m-%d %H:%M:%S UTC").to_string())
}

fn digits(commit: &str) -> &str {
    commit.get(..COMMIT_DIGITS).unwrap_or(commit)
}

/// The first screen.
#[derive(Clone, Debug, Default)]
pub struct Screen {
    /// Where the figures are from.
    pub made: Option<Made>,
    /// With which instruments, by whom and at which temperature: name and text.
    pub conditions: Vec<(String, String)>,
    /// One sentence.
    pub verdict: Option<(String, Tone)>,
    /// What was found, the most important first.
    pub tiles: Vec<Tile>,
    /// What failed, was lost, not evaluated or not stated, a sentence each.
    pub lacks: Vec<String>,
    /// What to do next, such as a test with its minutes.
    pub next: Option<Tile>,
    /// One picture that shows it, with its caption.
    pub picture: Option<Markup>,
    /// What stands at the end of the page: conditions, recording.
    pub behind: Vec<Markup>,
}

impl Screen {
    /// This screen with that of another part behind it.
    pub fn join(&mut self, other: Self) {
        self.made = self.made.take().or(other.made);
        self.conditions.extend(other.conditions);
        self.verdict = self.verdict.take().or(other.verdict);
        self.tiles.extend(other.tiles);
        self.lacks.extend(other.lacks);
        self.next = self.next.take().or(other.next);
        self.picture = self.picture.take().or(other.picture);
        self.behind.extend(other.behind);
    }

    /// The tiles that are shown: what was found as there is room, then what is lacking, then the next step.
    #[must_use]
    pub fn shown(&self) -> Vec<Tile> {
        let mut last: Vec<Tile> = self.lacking().into_iter().collect();
        last.extend(self.next.clone());
        let room = MOST_TILES - last.len();
        self.tiles.iter().take(room).cloned().chain(last).collect()
    }

    fn lacking(&self) -> Option<Tile> {
        let first = self.lacks.first()?;
        let value = match self.lacks.len() {
            1 => "1 remark".to_owned(),
            n => format!("{n} remarks"),
        };
        Some(Tile::new("failed or missing", value, capitalised(first)).toned(Tone::Bad))
    }

    /// The head of a page.
    #[must_use]
    pub fn html(&self, title: &str) -> Markup {
        let tiles = self.shown();
        html! {
            h1 { (title) }
            @if let Some(made) = &self.made { (made.html()) }
            @if !self.conditions.is_empty() {
                dl.facts {
                    @for (name, text) in &self.conditions { dt { (name) } dd { (text) } }
                }
            }
            @if let Some((verdict, tone)) = &self.verdict {
                p class=(format!("verdict {}", tone.class().unwrap_or_default())) { (verdict) }
            }
            @if !tiles.is_empty() { div.tiles { @for tile in &tiles { (tile.html()) } } }
            @if let Some(picture) = &self.picture { (picture) }
            @if self.lacks.len() > 1 {
                (super::page::fold("Failed or missing", None, false, &html! {
                    ul { @for line in &self.lacks { li { (capitalised(line)) } } }
                }))
            }
        }
    }
}

/// What a tool error is: no instrument read it, and it has no U.
pub const OF_THE_PLANT: &str = "true error of the simulated plant, read by no instrument";

/// The verdict on a tool error without and with compensation, mm, and its tile; `what` says of which poses.
#[must_use]
pub fn compensated(without_mm: f64, with_mm: f64, what: &str) -> Screen {
    let um = |mm: f64| super::svg::short(mm * 1e3);
    let is_less = with_mm < without_mm;
    let sentence = if is_less {
        format!(
            "Compensation takes the tool error from {} to {} µm (p95, {what}), {:.1}-fold less.",
            um(without_mm),
            um(with_mm),
            without_mm / with_mm
        )
    } else {
        format!(
            "Compensation makes the tool error no smaller: {} µm without it, {} µm with it (p95, {what}).",
            um(without_mm),
            um(with_mm)
        )
    };
    let tone = if is_less { Tone::Good } else { Tone::Bad };
    let value = format!("{} → {} µm", um(without_mm), um(with_mm));
    let tile = Tile::new(
        "tool error without → with compensation",
        value,
        format!("p95, {what}; {OF_THE_PLANT}"),
    );
    Screen {
        verdict: Some((sentence, tone)),
        tiles: vec![tile.toned(tone)],
        ..Screen::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn made() -> Made {
        Made {
            software: Software {
                version: "0.1.0",
                commit: "abcdef0123456789",
            },
            machine: Some("vmc <1>".to_owned()),
            namespaces: vec!["/mill_3".to_owned()],
            begin_nanos: Some(1_767_600_000_000_000_000),
            end_nanos: Some(1_767_603_600_000_000_000),
            source: "runs/first/bag".to_owned(),
            recorded_by: Some("0123456789abcdef".to_owned()),
            is_foreseen: false,
        }
    }

    #[test]
    fn machine_time_and_software_stand_at_the_head() {
        let screen = Screen {
            made: Some(made()),
            ..Screen::default()
        };
        let html = screen.html("Tests").into_string();
        for words in [
            "<h1>Tests</h1>",
            "vmc &lt;1&gt;",
            "<dt>Namespace</dt><dd>/mill_3</dd>",
            "2026-01-05 08:00:00 UTC to 2026-01-05 09:00:00 UTC",
            "recorded with 0123456789",
            "Abbe 0.1.0 (abcdef0123)",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
        assert_eq!(made().as_json()["begin"], "2026-01-05 08:00:00 UTC");
        let undated = Made {
            begin_nanos: Some(5),
            ..Made::default()
        };
        assert!(undated.as_json()["begin"].is_null());
        assert!(!undated.html().into_string().contains("Namespace"));
        let plan = Made::of_plan(
            made().software,
            "vmc",
            "plan.yaml",
            1_767_600_000_000_000_000,
        );
        let html = plan.html().into_string();
        for words in [
            "<dd>vmc</dd>",
            "<dt>Foreseen</dt><dd>2026-01-05 08:00:00 UTC</dd>",
            "<dt>Plan</dt><dd>plan.yaml</dd>",
        ] {
            assert!(html.contains(words), "{words}: {html}");
        }
        assert!(!html.contains("Measured"), "{html}");
    }

    #[test]
    fn instrument_operator_and_temperature_stand_before_the_verdict() {
        let screen = Screen {
            made: Some(made()),
            conditions: vec![("Operator".to_owned(), "A. B.".to_owned())],
            ..compensated(0.04, 0.002, "1 pose")
        };
        let html = screen.html("Tests").into_string();
        let place = |words: &str| {
            html.find(words)
                .unwrap_or_else(|| panic!("{words}: {html}"))
        };
        assert!(place("<dt>Measured</dt>") < place("<dt>Operator</dt><dd>A. B.</dd>"));
        assert!(place("A. B.") < place("Compensation takes"));
        assert!(!html.contains("<details"));
    }

    #[test]
    fn there_are_five_tiles_at_most_and_what_failed_is_among_them() {
        let tile = |k: usize| Tile::new("figure", k.to_string(), "");
        let screen = Screen {
            tiles: (0..9).map(tile).collect(),
            lacks: vec!["run 3: not completed.".to_owned(), "no budget.".to_owned()],
            next: Some(Tile::new("next step", "circle XY, 4 min", "")),
            ..Screen::default()
        };
        let shown = screen.shown();
        assert_eq!(shown.len(), MOST_TILES);
        assert_eq!(shown[3].value, "2 remarks");
        assert_eq!(shown[4].name, "next step");
        let html = screen.html("t").into_string();
        assert!(html.contains("No budget."), "{html}");
    }

    #[test]
    fn compensation_that_makes_it_worse_is_no_success() {
        let (verdict, tone) = compensated(0.0415, 0.0027, "12 poses").verdict.unwrap();
        assert!(verdict.contains("from 41.5 to 2.70 µm"), "{verdict}");
        assert_eq!(tone, Tone::Good);
        let (verdict, tone) = compensated(0.002, 0.003, "12 poses").verdict.unwrap();
        assert!(verdict.contains("no smaller"), "{verdict}");
        assert_eq!(tone, Tone::Bad);
    }

    #[test]
    fn the_first_verdict_and_picture_stay_and_what_is_lacking_adds_up() {
        let mut first = compensated(0.04, 0.002, "1 pose");
        let mut second = compensated(0.05, 0.1, "2 poses");
        second.lacks.push("lost".to_owned());
        second.picture = Some(html! { "picture" });
        first.join(second);
        assert_eq!(first.verdict.map(|(_, tone)| tone), Some(Tone::Good));
        assert_eq!((first.tiles.len(), first.lacks.len()), (2, 1));
        assert!(first.picture.is_some());
    }

    #[test]
    fn a_long_remark_is_cut_at_a_word() {
        let long = "word ".repeat(80);
        let cut = shortened(&long);
        assert!(cut.chars().count() <= MOST_LETTERS_OF_TILE + 2 && cut.ends_with("word …"));
        assert_eq!(shortened("short"), "short");
    }
}
