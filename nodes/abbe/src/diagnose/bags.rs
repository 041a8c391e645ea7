//! Reads bags into one session.

use std::path::{Path, PathBuf};

use abbe_msgs::topics::{self, Topic};
use abbe_msgs::{Message, Wire, from_cdr};
use anyhow::{Context, Result, anyhow, bail};
use gap_diagnosis::report;
use gap_diagnosis::session::{Input, SessionBuilder, SessionConfig};
use machine::MachineFile;
use machine::file::AxisEntry;
use machine::twin::Session;
use recorder::{Bag, Event, Order};
use sha2::{Digest, Sha256};

/// The attachment that holds the machine file of a recording.
const MACHINE: &str = "machine.yaml";

/// What bags hold, as one session.
pub struct Recorded {
    /// The session.
    pub session: Session,
    /// Each bag with its hash and counts.
    pub bags: Vec<report::Bag>,
    /// What was left out, in words.
    pub remarks: Vec<String>,
    /// What could not be read, in words.
    pub losses: Vec<String>,
}

impl Recorded {
    /// Reads bags one after another.
    ///
    /// # Errors
    /// When one cannot be read, holds a message that is none, or is another machine's.
    pub fn read(paths: &[PathBuf], machine: &MachineFile) -> Result<Self> {
        let mut builder = SessionBuilder::new(machine, SessionConfig::default())?;
        let (mut losses, mut hashes, mut ends) = (vec![], vec![], vec![]);
        for path in paths {
            let bag = Bag::open(path).with_context(|| format!("bag {}", path.display()))?;
            if let Some(attachment) = bag.attachment(MACHINE)? {
                is_of(&attachment.data, machine)
                    .with_context(|| format!("bag {}", path.display()))?;
            }
            builder.next_bag();
            losses.extend(
                messages(&bag, &mut builder).with_context(|| format!("bag {}", path.display()))?,
            );
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
            .map_err(|error| not_whole(error.into(), &losses))?;
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
            remarks: account.remarks().collect(),
            losses,
        })
    }
}

/// What bags lack may have been in what was lost of them, which is said first.
pub fn not_whole(lacking: anyhow::Error, losses: &[String]) -> anyhow::Error {
    if losses.is_empty() {
        return lacking;
    }
    lacking.context(format!("a part was lost: {}", losses.join("; ")))
}

/// Lengths and angles of two machine files that differ by less are one.
const SAME: f64 = 1e-9;

/// Whether a machine file may be that of the machine which another one, of the recording, describes: what is built
/// into a machine is the same in both. One that cannot be read, as of an older format, tells nothing.
fn is_of(recorded: &[u8], machine: &MachineFile) -> Result<()> {
    let parse = |text| MachineFile::parse(text, MACHINE).ok();
    let Some(recorded) = std::str::from_utf8(recorded).ok().and_then(parse) else {
        return Ok(());
    };
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
            if (found - wanted).abs() > SAME {
                bail!(
                    "axes.{axis}.{key}: {found} in the recording, {wanted} in the machine file: it is another machine's"
                );
            }
        }
    }
    Ok(())
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
    let Some(attachment) = bag.attachment(MACHINE)? else {
        let none = anyhow!("holds no machine file: name it with --machine");
        let none = not_whole(none, &losses(&bag));
        return Err(none.context(format!("bag {}", path.display())));
    };
    let name = format!("machine.yaml of {}", path.display());
    let text = String::from_utf8(attachment.data).with_context(|| name.clone())?;
    Ok((name, text))
}

/// What of a bag cannot be read, in words.
fn losses(bag: &Bag) -> Vec<String> {
    let mut losses = vec![];
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        if let Event::Loss(loss) = event {
            losses.push(loss.to_string());
        }
    }
    losses
}

fn hash(bag: &Bag) -> Result<String> {
    let mut hash = Sha256::new();
    for path in bag.files() {
        let mut file = std::fs::File::open(path).with_context(|| format!("{}", path.display()))?;
        std::io::copy(&mut file, &mut hash).with_context(|| format!("{}", path.display()))?;
    }
    Ok(format!("{:x}", hash.finalize()))
}

fn messages(bag: &Bag, builder: &mut SessionBuilder) -> Result<Vec<String>> {
    let names: Vec<String> = bag
        .topics()
        .iter()
        .map(|info| info.topic.trim_start_matches('/').to_owned())
        .collect();
    let mut losses = vec![];
    let mut messages = bag.messages(Order::LogTime);
    while let Some(event) = messages.next_event() {
        match event {
            Event::Message(message) => {
                let name = names.get(message.topic.index()).map_or("", String::as_str);
                if let Some(input) = input(name, message.data)? {
                    builder.take(input);
                }
            }
            Event::Loss(loss) => losses.push(format!("{loss}")),
        }
    }
    Ok(losses)
}

/// Whether `name` is `topic`, in whatever namespace.
fn is<M: Message>(name: &str, topic: &Topic<M>) -> bool {
    name.strip_suffix(topic.name)
        .is_some_and(|space| space.is_empty() || space.ends_with('/'))
}

fn read<M: Message + Wire>(_: &Topic<M>, bytes: &[u8]) -> Result<M::Inner> {
    Ok(from_cdr::<M>(bytes)?.into_inner()?)
}

fn input(name: &str, bytes: &[u8]) -> Result<Option<Input>> {
    Ok(Some(if is(name, &topics::AXES_STATE) {
        Input::State(read(&topics::AXES_STATE, bytes)?)
    } else if is(name, &topics::GRID_POSITION) {
        Input::Grid(read(&topics::GRID_POSITION, bytes)?)
    } else if is(name, &topics::LENGTH_POSITION) {
        Input::Length(read(&topics::LENGTH_POSITION, bytes)?)
    } else if is(name, &topics::COMPENSATION) {
        Input::Compensation(read(&topics::COMPENSATION, bytes)?)
    } else if is(name, &topics::PROBE_TRIGGER) {
        Input::Trigger(read(&topics::PROBE_TRIGGER, bytes)?)
    } else if is(name, &topics::BLOCKS_MEASUREMENT) {
        Input::Block(read(&topics::BLOCKS_MEASUREMENT, bytes)?)
    } else if is(name, &topics::TEST_SEGMENT) {
        Input::Segment(read(&topics::TEST_SEGMENT, bytes)?)
    } else if let Some(sensor) = topics::TEMPERATURE.member_of(name) {
        let mut sample =
            from_cdr::<abbe_msgs::sensor_msgs::msg::Temperature>(bytes)?.into_inner()?;
        sensor.clone_into(&mut sample.sensor);
        Input::Temperature(sample)
    } else {
        return Ok(None);
    }))
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

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
