//! Machine coordinates on a LinuxCNC whose state nobody vouches for.
//!
//! A machine keeps what its last job left: work offsets, G92 or G52, a rotation, a tool length, G91, G20. A
//! program whose coordinates are the machine's (`(frame: machine)`, see [`machine::program_frame`]) is run between
//! two exchanges with LinuxCNC, all of them MDI blocks and questions:
//!
//! 1. **Find.** Active G codes, mode, offsets (`#5210…`), the first work system whose offset and rotation are all
//!    zero (`#5221…`), F and S. Where G92 or G52 shifts the axes, where every work system is in use, or where
//!    cutter compensation is on, the program is refused with what was found: no offset is ever overwritten.
//! 2. **Assert and verify.** The block of [`Modal::assertion`]; then LinuxCNC's own line of active codes must have
//!    all of its words, and its absolute and relative positions must be equal.
//! 3. The program runs, beginning with the work system; [`crate::watch`] compares where it goes.
//! 4. **Put back**, however the program ended: tool length by its values, the words that differ, F and S, the mode;
//!    verified by the line of active codes. The tolerance of G64 cannot be read: M70 before and M72 after keep it,
//!    where neither a spindle turned (M72 would turn it on again) nor an abort made the interpreter anew.
//!
//! `get spindle` is not used: it ends `linuxcncrsh` of LinuxCNC 2.9.

use metrology::stamp::{Host, Span, Stamp};

use crate::modal::{Group, Modal, SYSTEMS};
use crate::protocol::{Client, Mode, Query, Reply, Request, Setting, Signal};
use crate::work_systems::{Shift, WorkSystem, all_in_use, shifted};

/// A step of an exchange is over after this time, or LinuxCNC does not take part. Nothing moves meanwhile, and a busy
/// computer keeps LinuxCNC's interpreter waiting for seconds.
const STEP_LIMIT: Span = Span::from_nanos(15_000_000_000);
/// Absolute and relative positions are equal to within this, mm or deg: LinuxCNC prints 1e-6.
const EQUAL: f64 = 1e-5;
/// Offsets are those that were found to within this, mm or deg.
const EQUAL_OFFSETS: f64 = 1e-4;
/// Most inquiries of one program.
const TOKENS: u32 = 16;
/// Numbers in the answer about the state: #5210 to #5219, F, S, whether the spindle turns.
const STATE_NUMBERS: usize = 13;
/// Numbers in the answer about a work system: nine axes and the rotation.
const SYSTEM_NUMBERS: usize = 10;
/// Positions as programs see them, then without any offset. In a work system without offset, under no G92, they
/// differ by the tool's offset: no parameter has one that G43.1 gave.
const TOOL_PARAMETERS: &str = "#<_x> #<_y> #<_z> #<_a> #<_b> #<_c> #<_abs_x> #<_abs_y> #<_abs_z> #<_abs_a> #<_abs_b> #<_abs_c>";
/// Numbers in that answer.
const TOOL_NUMBERS: usize = 12;

/// What came of an exchange.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameNews {
    /// The state is verified; the program may run in `system`.
    Ready {
        /// Work system without offset and rotation.
        system: &'static str,
        /// What is not as it was found, where anything is.
        changed: Option<String>,
    },
    /// The program cannot run in machine coordinates, and why.
    Refused(String),
    /// The state that was found is there again; or what is not.
    PutBack(Result<(), String>),
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Finding,
    AskingState,
    AskingSystem(usize),
    AskingTool { system: usize },
    Asserting { system: usize },
    Comparing { system: usize },
    Ready,
    Looking,
    PuttingBack,
    Confirming,
    Leaving,
    Over,
}

/// What was there before.
#[derive(Clone, Debug, PartialEq)]
struct Found {
    mode: Mode,
    modal: Modal,
    /// Sum of work offset, G92 and G52, in the units that were active.
    work: Vec<f64>,
    /// The tool's offset, mm or deg; empty where G49 was active.
    tool: Vec<f64>,
    feed: f64,
    speed_rpm: f64,
    /// M70 has kept it.
    is_kept: bool,
}

/// One program's exchanges.
#[derive(Clone, Debug)]
pub struct Frame {
    step: Step,
    since: Option<Stamp<Host>>,
    token: u32,
    mode: Option<Mode>,
    modal: Option<Modal>,
    absolute: Vec<f64>,
    relative: Vec<f64>,
    /// Work offset as it is after putting back, in the units of [`Found::work`].
    work_left: Vec<f64>,
    found: Option<Found>,
    systems: Vec<WorkSystem>,
    /// The one that is used.
    system: usize,
    asserted: bool,
    /// The tool's offset, which was put back, has yet to be seen.
    tool_unseen: bool,
    /// What could not be put back.
    left: Option<String>,
}

impl Frame {
    /// Begins with program `number`: asks for everything that can be had without MDI.
    #[must_use]
    pub fn begin(number: u32, client: &mut Client) -> Self {
        for query in [
            Query::Mode,
            Query::ProgramCodes,
            Query::AbsCmdPos,
            Query::RelCmdPos,
            Query::PosOffset,
        ] {
            client.ask(Request::Get(query));
        }
        Self {
            step: Step::Finding,
            since: None,
            // An answer to another program's inquiry, which came late, answers none of this one's.
            token: number.wrapping_mul(TOKENS),
            mode: None,
            modal: None,
            absolute: Vec::new(),
            relative: Vec::new(),
            work_left: Vec::new(),
            found: None,
            systems: Vec::new(),
            system: 0,
            asserted: false,
            tool_unseen: false,
            left: None,
        }
    }

    /// Whether the state has been changed and not been put back.
    #[must_use]
    pub fn owes(&self) -> bool {
        self.found.is_some() && self.step != Step::Over
    }

    /// The state that was found, for a person to put it back.
    #[must_use]
    pub fn found(&self) -> String {
        { self.found.as_ref() }.map_or_else(String::new, |found| found.modal.to_string())
    }

    /// Time has passed: ask again for what takes its time, and notice what takes too long.
    pub fn tick(&mut self, at: Stamp<Host>, client: &mut Client) -> Option<FrameNews> {
        let since = *self.since.get_or_insert(at);
        // A host clock that went back makes nothing wait longer.
        self.since = Some(since.min(at));
        if matches!(self.step, Step::Ready | Step::Over) {
            return None;
        }
        if at - since > STEP_LIMIT {
            return self.late(client);
        }
        if client.is_idle() {
            match self.step {
                Step::AskingState | Step::AskingSystem(_) | Step::AskingTool { .. } => {
                    client.ask(Request::Get(Query::OperatorDisplay));
                }
                Step::PuttingBack if self.tool_unseen => {
                    client.ask(Request::Get(Query::OperatorDisplay));
                    client.ask(Request::Get(Query::ProgramCodes));
                }
                Step::Asserting { .. } | Step::Looking | Step::PuttingBack => {
                    client.ask(Request::Get(Query::ProgramCodes));
                }
                Step::Confirming => client.ask(Request::Get(Query::PosOffset)),
                Step::Comparing { .. } => {
                    client.ask(Request::Get(Query::AbsCmdPos));
                    client.ask(Request::Get(Query::RelCmdPos));
                }
                _ => {}
            }
        }
        None
    }

    fn late(&mut self, client: &mut Client) -> Option<FrameNews> {
        let limit_s = STEP_LIMIT.as_secs_f64();
        if let (Step::Confirming, Some(found), false) =
            (self.step, &self.found, self.work_left.is_empty())
        {
            let (was, is) = (Shift::of(&found.work, 0.0), Shift::of(&self.work_left, 0.0));
            self.left = Some(format!("work offset {was} was found and {is} is left"));
            self.leave(client);
            return None;
        }
        Some(match (self.step, &self.found, &self.modal) {
            (Step::PuttingBack, Some(found), Some(now)) => {
                let mut left = found.modal.differences(now);
                if self.tool_unseen {
                    left.push(format!("tool length {}", Shift::of(&found.tool, 0.0)));
                }
                let left = left.join(", ");
                self.step = Step::Over;
                FrameNews::PutBack(Err(left))
            }
            (Step::Looking | Step::PuttingBack | Step::Confirming | Step::Leaving, ..) => {
                self.step = Step::Over;
                FrameNews::PutBack(Err(format!("no answer within {limit_s} s")))
            }
            (Step::Asserting { system }, _, Some(now)) => FrameNews::Refused(format!(
                "machine coordinates: {} did not become active within {limit_s} s (active: {now})",
                now.missing(SYSTEMS[system]).join(" ")
            )),
            (Step::Comparing { system }, ..) if !self.relative.is_empty() => {
                FrameNews::Refused(format!(
                    "machine coordinates: with {} and every offset off, LinuxCNC still shifts its axes by {}: find what does so \
                     at the control",
                    SYSTEMS[system],
                    self.apart()
                ))
            }
            _ => FrameNews::Refused(format!(
                "machine coordinates: LinuxCNC did not report its offsets within {limit_s} s: another user interface \
                 may take its messages; close it and run again"
            )),
        })
    }

    /// Takes an answer.
    pub fn hear(&mut self, signal: &Signal, client: &mut Client) -> Option<FrameNews> {
        let Signal::Reply(reply) = signal else {
            return None;
        };
        match (self.step, reply) {
            (_, Reply::Mode(mode)) => self.mode = Some(*mode),
            (_, Reply::ProgramCodes(codes)) => return self.heard_codes(codes, client),
            (_, Reply::AbsCmdPos(position)) => self.absolute.clone_from(position),
            (Step::Comparing { system }, Reply::RelCmdPos(position)) => {
                self.relative.clone_from(position);
                return self.compare(system, client);
            }
            (_, Reply::RelCmdPos(position)) => self.relative.clone_from(position),
            (Step::Finding, Reply::PosOffset(offset)) => return self.all_found(offset, client),
            (Step::Confirming, Reply::PosOffset(offset)) => self.confirm(offset, client),
            (Step::AskingState, Reply::OperatorDisplay(Some(text))) => {
                let numbers = self.numbers(text, STATE_NUMBERS)?;
                return self.heard_state(&numbers, client);
            }
            (Step::AskingSystem(index), Reply::OperatorDisplay(Some(text))) => {
                let numbers = self.numbers(text, SYSTEM_NUMBERS)?;
                return self.heard_system(index, &numbers, client);
            }
            (Step::AskingTool { system }, Reply::OperatorDisplay(Some(text))) => {
                let tool = apart(&self.numbers(text, TOOL_NUMBERS)?);
                if let Some(found) = &mut self.found {
                    found.tool = tool;
                }
                client.ask(Request::Set(Setting::Mdi("G49".to_owned())));
                client.ask(Request::Get(Query::ProgramCodes));
                self.go(Step::Asserting { system });
            }
            (Step::PuttingBack, Reply::OperatorDisplay(Some(text))) if self.tool_unseen => {
                let tool = apart(&self.numbers(text, TOOL_NUMBERS)?);
                self.tool_unseen = false;
                self.compare_tool(&tool);
                client.ask(Request::Get(Query::ProgramCodes));
            }
            (Step::Leaving, Reply::Taken(Setting::Mode(_))) => {
                self.go(Step::Over);
                return Some(FrameNews::PutBack(self.left.take().map_or(Ok(()), Err)));
            }
            _ => {}
        }
        None
    }

    fn go(&mut self, step: Step) {
        self.step = step;
        self.since = None;
    }

    /// Asks LinuxCNC to tell the values of `parameters`, under a number of their own.
    fn inquire(&mut self, parameters: &str, client: &mut Client) {
        self.token = self.token.wrapping_add(1);
        let block = format!("(debug,abbe {} {parameters})", self.token);
        client.ask(Request::Set(Setting::Mdi(block)));
    }

    /// The numbers of an answer to the last inquiry; `None` for any other message.
    fn numbers(&self, text: &str, count: usize) -> Option<Vec<f64>> {
        let mut words = text.split_ascii_whitespace();
        if words.next() != Some("abbe") || words.next()?.parse() != Ok(self.token) {
            return None;
        }
        let numbers: Vec<f64> = words.map(|word| word.parse().ok()).collect::<Option<_>>()?;
        (numbers.len() == count && numbers.iter().all(|number| number.is_finite()))
            .then_some(numbers)
    }

    fn all_found(&mut self, offset: &[f64], client: &mut Client) -> Option<FrameNews> {
        let (Some(mode), Some(modal)) = (self.mode, self.modal.clone()) else {
            let refusal =
                "machine coordinates: LinuxCNC's line of active G codes is not understood";
            return Some(FrameNews::Refused(refusal.to_owned()));
        };
        let cutter = modal.word(Group::Cutter);
        if cutter != "G40" {
            return Some(FrameNews::Refused(format!(
                "machine coordinates: cutter compensation {cutter} is active: end it at the control (G40)"
            )));
        }
        self.found = Some(Found {
            mode,
            modal,
            work: offset.to_vec(),
            tool: Vec::new(),
            feed: 0.0,
            speed_rpm: 0.0,
            is_kept: false,
        });
        client.ask(Request::Set(Setting::Mode(Mode::Mdi)));
        let axes: Vec<String> = (5210..=5219).map(|number| format!("#{number}")).collect();
        self.inquire(
            &format!("{} #<_feed> #<_rpm> #<_spindle_on>", axes.join(" ")),
            client,
        );
        self.go(Step::AskingState);
        None
    }

    fn heard_state(&mut self, numbers: &[f64], client: &mut Client) -> Option<FrameNews> {
        let (active, shift) = (numbers[0] != 0.0, Shift::of(&numbers[1..10], 0.0));
        if active && !shift.is_zero() {
            return Some(FrameNews::Refused(shifted(&shift)));
        }
        if let Some(found) = &mut self.found {
            (found.feed, found.speed_rpm) = (numbers[10], numbers[11]);
            found.is_kept = found.modal.word(Group::Path) == "G64" && numbers[12] == 0.0;
        }
        self.ask_system(0, client);
        None
    }

    fn ask_system(&mut self, index: usize, client: &mut Client) {
        let first = 5221 + 20 * index;
        let numbers: Vec<String> = (first..first + SYSTEM_NUMBERS)
            .map(|n| format!("#{n}"))
            .collect();
        self.inquire(&numbers.join(" "), client);
        self.go(Step::AskingSystem(index));
    }

    fn heard_system(
        &mut self,
        index: usize,
        numbers: &[f64],
        client: &mut Client,
    ) -> Option<FrameNews> {
        let shift = Shift::of(&numbers[..9], numbers[9]);
        let is_free = shift.is_zero();
        self.systems.push(WorkSystem {
            name: SYSTEMS[index],
            shift,
        });
        if is_free {
            self.assert(index, client);
        } else if index + 1 < SYSTEMS.len() {
            self.ask_system(index + 1, client);
        } else {
            return Some(FrameNews::Refused(all_in_use(&self.systems)));
        }
        None
    }

    fn assert(&mut self, system: usize, client: &mut Client) {
        self.system = system;
        let Some(found) = &self.found else { return };
        if found.is_kept {
            client.ask(Request::Set(Setting::Mdi("M70".to_owned())));
        }
        let block = found.modal.assertion(SYSTEMS[system]);
        self.asserted = true;
        if found.modal.word(Group::Tool) == "G49" {
            client.ask(Request::Set(Setting::Mdi(block)));
            client.ask(Request::Get(Query::ProgramCodes));
            self.go(Step::Asserting { system });
        } else {
            // Its offset shows once nothing else shifts the axes.
            let block = block.replace(" G49", "");
            client.ask(Request::Set(Setting::Mdi(block)));
            self.inquire(TOOL_PARAMETERS, client);
            self.go(Step::AskingTool { system });
        }
    }

    fn heard_codes(&mut self, codes: &str, client: &mut Client) -> Option<FrameNews> {
        self.modal = Modal::read(codes);
        let modal = self.modal.clone()?;
        match self.step {
            Step::Asserting { system } if modal.missing(SYSTEMS[system]).is_empty() => {
                self.relative.clear();
                client.ask(Request::Get(Query::AbsCmdPos));
                client.ask(Request::Get(Query::RelCmdPos));
                self.go(Step::Comparing { system });
            }
            Step::Looking => self.put_back_words(&modal, client),
            Step::PuttingBack => {
                let found = self.found.as_ref()?;
                if found.modal.differences(&modal).is_empty() && !self.tool_unseen {
                    self.work_left.clear();
                    client.ask(Request::Get(Query::PosOffset));
                    self.go(Step::Confirming);
                }
            }
            _ => {}
        }
        None
    }

    /// What still shifts the axes.
    fn apart(&self) -> Shift {
        let apart = { self.absolute.iter().zip(&self.relative) }
            .map(|(absolute, relative)| absolute - relative);
        Shift::of(&apart.collect::<Vec<_>>(), 0.0)
    }

    /// `None`: positions differ. LinuxCNC's line of active codes is ahead of its positions, since its interpreter reads ahead of
    /// what is carried out, so they are asked for again until the step's limit.
    fn compare(&mut self, system: usize, client: &mut Client) -> Option<FrameNews> {
        if self.absolute.len() != self.relative.len() || !self.apart().is_zero_to(EQUAL) {
            return None;
        }
        client.ask(Request::Set(Setting::Mode(Mode::Auto)));
        self.go(Step::Ready);
        let changed = self.found.as_ref().and_then(|found| {
            let missing = found.modal.missing(SYSTEMS[system]);
            let system_found = found.modal.word(Group::System);
            let left = self.systems.iter().find(|known| known.name == system_found);
            let kept = left.filter(|known| !known.shift.is_zero());
            (!missing.is_empty()).then(|| {
                let was = { kept }.map_or_else(String::new, |known| format!(" ({})", known.shift));
                format!(
                    "{} are set for this program, which found {}{was}",
                    missing.join(" "),
                    found.modal
                )
            })
        });
        Some(FrameNews::Ready {
            system: SYSTEMS[system],
            changed,
        })
    }

    /// The program is over, or never began: put back what was found. `was_reset`: an abort made LinuxCNC's
    /// interpreter anew, so that nothing that M70 kept is left.
    pub fn put_back(&mut self, was_reset: bool, client: &mut Client) {
        if let Some(found) = &mut self.found {
            found.is_kept &= self.asserted && !was_reset;
            let lost = self.asserted && !found.is_kept && found.modal.word(Group::Path) == "G64";
            self.left = lost.then(|| "the tolerance P of G64, which cannot be read".to_owned());
        }
        client.forget_unsent();
        client.ask(Request::Get(Query::ProgramCodes));
        self.go(Step::Looking);
    }

    fn put_back_words(&mut self, now: &Modal, client: &mut Client) {
        let found = self.found.clone().filter(|_| self.asserted);
        if let Some(found) = found {
            client.ask(Request::Set(Setting::Mode(Mode::Mdi)));
            for block in found.tool_blocks(SYSTEMS[self.system]) {
                client.ask(Request::Set(Setting::Mdi(block)));
            }
            self.tool_unseen = !found.tool.is_empty();
            if self.tool_unseen {
                self.inquire(TOOL_PARAMETERS, client);
            }
            for block in found.blocks(now) {
                client.ask(Request::Set(Setting::Mdi(block)));
            }
        }
        client.ask(Request::Get(Query::ProgramCodes));
        self.go(Step::PuttingBack);
    }

    fn compare_tool(&mut self, tool: &[f64]) {
        let found = self
            .found
            .as_ref()
            .filter(|found| differ(&found.tool, tool));
        if let Some(found) = found {
            let (was, is) = (Shift::of(&found.tool, 0.0), Shift::of(tool, 0.0));
            self.left = Some(format!("tool length {was} was found and {is} is left"));
        }
    }

    /// The words are those that were found: what the axes are shifted by must be, too.
    /// Positions follow the line of active codes here as in [`Self::compare`].
    fn confirm(&mut self, work: &[f64], client: &mut Client) {
        let is_back = { self.found.as_ref() }.is_some_and(|found| !differ(&found.work, work));
        self.work_left = work.to_vec();
        if is_back {
            self.leave(client);
        }
    }

    fn leave(&mut self, client: &mut Client) {
        if let Some(found) = &self.found {
            client.ask(Request::Set(Setting::Mode(found.mode)));
            self.go(Step::Leaving);
        }
    }
}

fn differ(found: &[f64], now: &[f64]) -> bool {
    found.len() != now.len()
        || found
            .iter()
            .zip(now)
            .any(|(a, b)| (a - b).abs() > EQUAL_OFFSETS)
}

/// By how much the second half of positions is beyond the first.
fn apart(positions: &[f64]) -> Vec<f64> {
    let (programs, absolute) = positions.split_at(positions.len() / 2);
    { absolute.iter().zip(programs) }
        .map(|(absolute, program)| absolute - program)
        .collect()
}

impl Found {
    /// Blocks that put the context of M70 and the tool's offset back, in work system `system`, which shifts nothing.
    fn tool_blocks(&self, system: &str) -> Vec<String> {
        let mut blocks = Vec::new();
        if self.is_kept {
            blocks.push("M72".to_owned());
        }
        let tool = ["X", "Y", "Z", "A", "B", "C"].iter().zip(&self.tool);
        let tool: Vec<String> = { tool }
            .filter(|(_, offset)| offset.abs() > EQUAL_OFFSETS)
            .map(|(axis, offset)| format!("{axis}{offset:.6}"))
            .collect();
        if !tool.is_empty() {
            let radius = if self.modal.word(Group::Diameter) == "G7" {
                " G8"
            } else {
                ""
            };
            blocks.push(format!("G21{radius} {system}"));
            blocks.push(format!("G43.1 {}", tool.join(" ")));
        }
        blocks
    }

    /// Blocks that put the words back where `now` is active, then F and S.
    fn blocks(&self, now: &Modal) -> Vec<String> {
        let changed = self.modal.restoring(now).unwrap_or_default();
        // G64 without its tolerance would take away what M72 has put back.
        let changed = changed
            .split(' ')
            .filter(|word| !(self.is_kept && *word == "G64"));
        let mut words: Vec<&str> = changed.filter(|word| !word.is_empty()).collect();
        if !self.tool.is_empty() {
            for group in [Group::Units, Group::System, Group::Diameter] {
                let word = self.modal.word(group);
                if !word.is_empty() && !words.contains(&word) {
                    words.push(word);
                }
            }
        }
        let mut blocks = Vec::new();
        if !words.is_empty() {
            blocks.push(words.join(" "));
        }
        blocks.push(format!("F{:.4} S{:.4}", self.feed, self.speed_rpm));
        blocks
    }
}
