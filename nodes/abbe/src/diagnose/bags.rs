//! Reads bags into one session.

use std::path::{Path, PathBuf};

use abbe_msgs::topics;
use anyhow::{Context, Result, anyhow, bail};
use gap_diagnosis::report;
use gap_diagnosis::session::{self, Account, Input, SessionBuilder, SessionConfig};
use machine::MachineFile;
use machine::file::AxisEntry;
use metrology::text::{self, Comments};
use recorder::{Bag, MACHINE_FILE, Order};
use replayer::{Reading, Reason, Taken, machines, reading};
use reports::loss;
use sha2::{Digest, Sha256};
use twin::Session;

use crate::import;

/// What bags hold, as one session.
pub struct Recorded {
    /// The session.
    pub session: Session,
    /// Each bag with its hash and counts.
    pub bags: Vec<report::Bag>,
    /// What of the runs could not be used, in words.
    pub omitted: Vec<String>,
    /// What was left out and is no loss, in words.
    pub remarks: Vec<String>,
    /// What of each bag was read, lost and left out.
    pub readings: Vec<Reading>,
}

impl Recorded {
    /// Reads bags one after another.
    ///
    /// # Errors
    /// When one cannot be opened, or is another machine's.
    pub fn read(paths: &[PathBuf], machine: &MachineFile) -> Result<Self> {
        Self::of(paths, machine, true)
    }

    /// Reads the bags of a simulator, whose machine may have a name of its own.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn of_simulator(paths: &[PathBuf], machine: &MachineFile) -> Result<Self> {
        Self::of(paths, machine, false)
    }

    fn of(paths: &[PathBuf], machine: &MachineFile, is_recording: bool) -> Result<Self> {
        let mut builder = SessionBuilder::new(machine, SessionConfig::of_bags())?;
        let (mut readings, mut hashes, mut ends) = (vec![], vec![], vec![]);
        for path in paths {
            let bag = Bag::open(path).with_context(|| format!("bag {}", path.display()))?;
            machines::check(bag.topics()).with_context(|| format!("bag {}", path.display()))?;
            // A damaged one is among the losses of the bag.
            if let Ok(Some(attachment)) = bag.attachment(MACHINE_FILE) {
                is_of(&attachment.data, machine, is_recording)
                    .with_context(|| format!("bag {}", path.display()))?;
            }
            builder.next_bag();
            readings.push(messages(&bag, &mut builder));
            let hash = hash(&bag)?;
            if let Some(place) = hashes.iter().position(|known| *known == hash) {
                bail!(
                    "bag {}: is the same as {}, byte for byte: a copy repeats nothing, name each recording once",
                    path.display(),
                    paths[place].display()
                );
            }
            hashes.push(hash);
            builder.end_bag();
            ends.push(builder.runs().len());
        }
        let (session, account) = builder
            .finish()
            .map_err(|error| not_whole(error.into(), &loss::lines(&readings)))?;
        let mut from = 0;
        let bags = paths
            .iter()
            .zip(hashes)
            .zip(ends)
            .map(|((path, sha256), end)| {
                let runs = session.runs.get(from..end).unwrap_or(&[]);
                from = end;
                report::Bag {
                    path: path.display().to_string(),
                    sha256,
                    runs: runs.len(),
                    samples: runs.iter().map(|run| run.readings.len()).sum(),
                }
            });
        let bags = bags.collect();
        Ok(Self {
            session,
            bags,
            omitted: omitted(&account, &readings),
            remarks: account.notes().collect(),
            readings,
        })
    }
}

/// What of the runs could not be used; states of another machine are in the account of the bag already.
fn omitted(account: &Account, readings: &[Reading]) -> Vec<String> {
    let topics = readings.iter().flat_map(|it| &it.account.topics);
    let mut left_out = topics.flat_map(|it| &it.left_out);
    let is_known = left_out.any(|it| it.reason == Reason::OtherMachine);
    let mut account = account.clone();
    if is_known {
        account.left_out.remove(&session::Reason::OtherMachine);
    }
    account.losses().collect()
}

/// What bags lack may have been in what was lost of them, which is said first.
pub fn not_whole(lacking: anyhow::Error, losses: &[String]) -> anyhow::Error {
    if losses.is_empty() {
        return lacking;
    }
    lacking.context(format!("a part was lost: {}", losses.join("; ")))
}

/// Lengths and angles of two machine files that differ by less are one.
const EQUAL_VALUES: f64 = 1e-9;

/// Whether a machine file may be that of the machine which another one, of the recording, describes: what is built
/// into a machine is the same in both. One that cannot be read, as of an older format, tells nothing.
fn is_of(recorded: &[u8], machine: &MachineFile, is_recording: bool) -> Result<()> {
    let parse = |text| MachineFile::parse(text, MACHINE_FILE).ok();
    let Some(recorded) = std::str::from_utf8(recorded).ok().and_then(parse) else {
        return Ok(());
    };
    if is_recording {
        same_name(&recorded.name, &machine.name)?;
    }
    if recorded.chain != machine.chain {
        bail!(
            "chain: {} in the recording, {} in the machine file: it is another machine's",
            recorded.chain,
            machine.chain
        );
    }
    for (axis, entry) in &machine.axes {
        let Some(known) = recorded.axes.get(axis) else {
            continue;
        };
        for ((key, found), (_, wanted)) in built(known).into_iter().zip(built(entry)) {
            if (found - wanted).abs() > EQUAL_VALUES {
                bail!(
                    "axes.{axis}.{key}: {found} in the recording, {wanted} in the machine file: it is another machine's"
                );
            }
        }
    }
    Ok(())
}

/// Refuses a recording of a machine that has another name: machines of one model differ in nothing else.
fn same_name(recorded: &str, machine: &str) -> Result<()> {
    if recorded == machine {
        return Ok(());
    }
    bail!(
        "name: {recorded} in the recording, {machine} in the machine file: it is another machine's; where it is the same one, give \
         the machine file its name ({recorded})"
    );
}

/// What of an axis no adjustment changes.
fn built(entry: &AxisEntry) -> Vec<(&'static str, f64)> {
    match entry {
        AxisEntry::Linear(axis) => vec![
            ("travel_mm, low", axis.travel_mm[0]),
            ("travel_mm, high", axis.travel_mm[1]),
            ("lead_mm", axis.lead_mm),
        ],
        AxisEntry::Rotary(axis) => vec![
            ("travel_deg, low", axis.travel_deg[0]),
            ("travel_deg, high", axis.travel_deg[1]),
        ],
    }
}

/// The machine file that a bag was recorded with.
///
/// # Errors
/// When the bag has none.
pub fn machine_text(path: &Path) -> Result<(String, String)> {
    let bag = Bag::open(path).with_context(|| format!("bag {}", path.display()))?;
    let attached = bag.attachment(MACHINE_FILE);
    let attached = attached.with_context(|| format!("bag {}", path.display()))?;
    let Some(attachment) = attached else {
        let none = anyhow!("holds no machine file: name it with --machine");
        let none = not_whole(none, &losses(&bag));
        return Err(none.context(format!("bag {}", path.display())));
    };
    let name = format!("machine.yaml of {}", path.display());
    let text = text::decode(&attachment.data, Comments::Yaml)
        .map_err(|wrong| anyhow!("{name}:{wrong}"))?;
    Ok((name, text))
}

/// Whether a bag was made of a table whose rows were not in the order of the measurement.
///
/// # Errors
/// When it cannot be opened.
pub fn is_in_no_order(path: &Path) -> Result<bool> {
    let bag = Bag::open(path).with_context(|| format!("bag {}", path.display()))?;
    // A damaged attachment is among the losses of the bag.
    let attached = bag.attachment(import::ATTACHMENT).ok().flatten();
    let lines = attached.map(|attached| attached.data).unwrap_or_default();
    let lines = String::from_utf8_lossy(&lines).into_owned();
    Ok(lines.lines().any(|line| line == import::ORDER_UNKNOWN))
}

/// What of a bag cannot be read, in words.
pub fn losses(bag: &Bag) -> Vec<String> {
    reading::read(bag, Order::LogTime, &[], |_| ()).lines()
}

/// SHA-256 of the files of a bag, in order.
///
/// # Errors
/// When one cannot be read.
pub fn hash(bag: &Bag) -> Result<String> {
    let mut hash = Sha256::new();
    for path in bag.files() {
        let mut file = std::fs::File::open(path).with_context(|| format!("{}", path.display()))?;
        std::io::copy(&mut file, &mut hash).with_context(|| format!("{}", path.display()))?;
    }
    Ok(format!("{:x}", hash.finalize()))
}

/// Hands what a bag says to the session; what cannot be used is left out and counted.
fn messages(bag: &Bag, builder: &mut SessionBuilder) -> Reading {
    let wanted = WANTED.each_ref().map(|(name, _)| *name);
    reading::read(bag, Order::LogTime, &wanted, |mut taken| {
        let of_topic = WANTED.iter().find(|(name, _)| taken.is_named(name));
        let input = of_topic.and_then(|(_, input)| input(&mut taken));
        let Some(input) = input else { return };
        if let Input::State(state) = &input
            && let Some(why) = builder.why_not_of_machine(state)
        {
            taken.leave_out(Reason::OtherMachine, || why.to_string());
        }
        builder.take(input);
    })
}

type ToInput = fn(&mut Taken<'_>) -> Option<Input>;

/// Topics that a diagnosis reads, and what each is to the session.
static WANTED: [(&str, ToInput); 8] = [
    (topics::AXES_STATE.name, |taken| {
        taken.of(&topics::AXES_STATE).map(Input::State)
    }),
    (topics::GRID_POSITION.name, |taken| {
        taken.of(&topics::GRID_POSITION).map(Input::Grid)
    }),
    (topics::LENGTH_POSITION.name, |taken| {
        taken.of(&topics::LENGTH_POSITION).map(Input::Length)
    }),
    (topics::COMPENSATION.name, |taken| {
        taken.of(&topics::COMPENSATION).map(Input::Compensation)
    }),
    (topics::PROBE_TRIGGER.name, |taken| {
        taken.of(&topics::PROBE_TRIGGER).map(Input::Trigger)
    }),
    (topics::BLOCKS_MEASUREMENT.name, |taken| {
        taken.of(&topics::BLOCKS_MEASUREMENT).map(Input::Block)
    }),
    (topics::TEST_SEGMENT.name, |taken| {
        taken.of(&topics::TEST_SEGMENT).map(Input::Segment)
    }),
    (topics::TEMPERATURE.base, |taken| {
        let mut sample = taken.of_member(&topics::TEMPERATURE)?;
        let sensor = topics::TEMPERATURE.member_of(taken.topic())?;
        sensor.clone_into(&mut sample.sensor);
        Some(Input::Temperature(sample))
    }),
];

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    #[test]
    fn a_recording_of_a_machine_with_another_name_is_refused_with_both() {
        let text = include_str!("../../../../launch_configs/gap_first/machine.yaml");
        let machine = MachineFile::parse(text, "m").unwrap();
        let named = |name: &str| text.replace("name: vmc_3x", &format!("name: {name}"));
        for name in ["vmc_17", "vmc_3x_b", "VMC_3X", "other"] {
            let refused = is_of(named(name).as_bytes(), &machine, true).unwrap_err();
            let refused = refused.to_string();
            let words = format!("name: {name} in the recording, vmc_3x in the machine file");
            assert!(refused.contains(&words), "{refused}");
            assert!(is_of(named(name).as_bytes(), &machine, false).is_ok());
        }
        let changed = format!("{text}\n# mended\n");
        assert!(is_of(changed.as_bytes(), &machine, true).is_ok());
    }

    #[test]
    fn a_bag_that_was_cut_is_told_as_such_before_what_it_lacks() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("bag.mcap");
        let mut file = std::fs::File::create(&path).unwrap();
        // The first bytes of a file, and of a header that ends too early.
        file.write_all(b"\x89MCAP0\r\n\x01\x40\0\0\0\0\0\0\0ros2")
            .unwrap();
        let lacking = format!("{:#}", machine_text(&path).unwrap_err());
        let (cut, lacks) = (
            lacking.find("a part was lost: "),
            lacking.find("holds no machine file"),
        );
        assert!(cut.is_some() && cut < lacks, "{lacking}");
        assert!(lacking.contains("cuts a record"), "{lacking}");
    }
}
