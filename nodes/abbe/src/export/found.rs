//! What a bag has for tables, and why it has nothing.

use abbe_msgs::topics;
use control_tables::selection::Measured;
use metrology::sample::PositioningTable;
use metrology::{Axis, AxisSet, PerAxis};
use recorder::{Bag, Order};
use replayer::{Reading, TopicAccount, machines, reading};
use reports::evaluate::stops::Stops;

use super::origin::{GEOMETRY, Origin, ROTARY, Said, THERMAL, Which};

/// What a bag has for an export.
#[derive(Default)]
pub(super) struct Found {
    /// The last table of each axis and the last models.
    pub measured: Measured,
    /// What was read, lost and left out.
    pub reading: Reading,
    /// Messages on each of [`TABLE_TOPICS`]; `None`: the bag has no such topic.
    pub topics: [Option<u64>; 4],
    /// Where the tables come from.
    pub origin: Origin,
}

/// Topics that tables are made of, and who publishes them when.
const TABLE_TOPICS: [(&str, &str); 4] = [
    (
        topics::POSITIONING_TABLE.name,
        "deviations of an axis from its scale, by axis_compensation when a positioning run gives a table",
    ),
    (
        topics::GEOMETRY_MODEL.name,
        "geometric errors, by grid_encoder after its circles",
    ),
    (
        topics::THERMAL_MODEL.name,
        "thermal drift, by thermal_model after a block cycle that follows a cold one",
    ),
    (
        topics::GEOMETRY_ROTARY.name,
        "errors of rotary axes, by rotary_axes after its spheres",
    ),
];

/// Whether `name` is `topic`; a machine's namespace may stand in front.
pub(super) fn is(name: &str, topic: &str) -> bool {
    name == topic || name.ends_with(&format!("/{topic}"))
}

/// What a bag says of a machine's errors: the first or the last table of each axis, and the last models.
pub(super) fn read(bag: &Bag, which: Which) -> Found {
    let mut found = Found::default();
    for info in bag.topics() {
        for ((topic, _), count) in TABLE_TOPICS.iter().zip(&mut found.topics) {
            if is(&info.topic, topic) {
                *count.get_or_insert(0) += info.message_count;
            }
        }
    }
    found.origin.began_nanos = bag.log_times_nanos().map(|(first, _)| first);
    let namespaces = machines::namespaces(bag.topics()).into_iter();
    found.origin.namespaces = namespaces.map(str::to_owned).collect();
    let (measured, origin) = (&mut found.measured, &mut found.origin);
    let wanted = TABLE_TOPICS.map(|(topic, _)| topic);
    found.reading = reading::read(bag, Order::LogTime, &wanted, |mut taken| {
        let at_nanos = taken.log_time_nanos();
        if taken.is(&topics::POSITIONING_TABLE)
            && let Some(table) = taken.of(&topics::POSITIONING_TABLE)
        {
            let axis = table.axis;
            let said = Said::new(&table, at_nanos);
            origin.tables[axis].get_or_insert_default().add(said);
            let known = &mut measured.tables[axis];
            if known.is_none() || which == Which::Last {
                *known = Some(table);
            }
        } else if taken.is(&topics::THERMAL_MODEL)
            && let Some(model) = taken.of(&topics::THERMAL_MODEL)
        {
            origin.add_model(THERMAL, at_nanos);
            measured.thermal = Some(model);
        } else if taken.is(&topics::GEOMETRY_MODEL)
            && let Some(model) = taken.of(&topics::GEOMETRY_MODEL)
        {
            origin.add_model(GEOMETRY, at_nanos);
            measured.geometry = Some(model);
        } else if taken.is(&topics::GEOMETRY_ROTARY)
            && let Some(model) = taken.of(&topics::GEOMETRY_ROTARY)
        {
            origin.add_model(ROTARY, at_nanos);
            measured.rotary = Some(model);
        }
    });
    found
}

/// A table for each axis that has none and stood at stops with nothing added to its commands; the last such run counts. The axes
/// that got one.
pub(super) fn tables_of_stops(stops: &[Stops], measured: &mut Measured) -> AxisSet {
    let mut tables = PerAxis::<Option<PositioningTable>>::default();
    for stops in stops.iter().filter(|stops| !stops.compensated) {
        tables[stops.axis] = Some(stops.table(1, 1.0));
    }
    let mut of_stops = AxisSet::EMPTY;
    for axis in Axis::ALL {
        let known = &mut measured.tables[axis];
        if known.is_none() && tables[axis].is_some() {
            *known = tables[axis].take();
            of_stops = of_stops.with(axis);
        }
    }
    of_stops
}

/// Whether a topic has messages and none of them could be used.
fn is_left_out(topic: &str, reading: &Reading) -> bool {
    let of_topic = |row: &&TopicAccount| is(&row.topic, topic);
    let mut rows = reading.account.topics.iter().filter(of_topic).peekable();
    rows.peek().is_some() && rows.all(|row| row.used == 0 && !row.left_out.is_empty())
}

/// Each source of tables with why it gave none.
pub(super) fn looked_for(
    measured: &Measured,
    (topics, reading): ([Option<u64>; 4], &Reading),
    (axes, of_references): (AxisSet, &PerAxis<Option<String>>),
) -> Vec<String> {
    let of_axes = |known: AxisSet| {
        let names: Vec<String> = known.iter().map(|axis| axis.to_string()).collect();
        format!(
            "it is about {}, what of that is in no table is said above",
            names.join(" ")
        )
    };
    let have = |is_known: &dyn Fn(Axis) -> bool| -> AxisSet {
        Axis::ALL
            .into_iter()
            .filter(|axis| is_known(*axis))
            .collect()
    };
    let tables = have(&|axis| measured.tables[axis].is_some() && of_references[axis].is_none());
    let references = have(&|axis| of_references[axis].is_some());
    let wanted: Vec<String> = axes.iter().map(|axis| axis.to_string()).collect();
    let mut lines: Vec<String> = TABLE_TOPICS
        .iter()
        .zip(topics)
        .map(|((topic, what), messages)| {
            let why = match messages {
                None => {
                    "the bag has no such topic: the node was not there or not recorded".to_owned()
                }
                Some(0) => "the bag has the topic, but nothing was published".to_owned(),
                Some(n) if is_left_out(topic, reading) => {
                    format!("each of its {n} messages was left out, as said below")
                }
                Some(_) if *topic == topics::POSITIONING_TABLE.name => of_axes(tables),
                Some(n) => {
                    format!("{n} messages, none that gives a table for these axes in this format")
                }
            };
            format!("{topic} ({what}): {why}")
        })
        .collect();
    lines.push(format!("for axes {}", wanted.join(" ")));
    let of_runs = if references.is_empty() {
        "none with targets that every run stopped at".to_owned()
    } else {
        of_axes(references)
    };
    lines.push(format!(
        "runs of a length or angular reference along one axis with nothing added to its commands: {of_runs}"
    ));
    lines.push("stops of verifications along one axis count with --stops alone".to_owned());
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use reports::evaluate::stops::Stop;

    fn stops(axis: Axis, slope: f64, compensated: bool) -> Stops {
        let places = (0..10).map(|k| f64::from(k) * 15.0);
        let both = places.flat_map(|at| [true, false].map(|up| (at, up)));
        Stops {
            run: 1,
            axis,
            by_scale: true,
            compensated,
            stops: both
                .map(|(commanded_mm, up)| Stop {
                    commanded_mm,
                    deviation_mm: slope * commanded_mm,
                    up,
                })
                .collect(),
        }
    }

    #[test]
    fn stops_make_a_table_where_there_is_none_and_where_nothing_was_added() {
        let mut measured = Measured::default();
        let of_positioning = stops(Axis::Y, 7e-5, false).table(1, 1.0);
        measured.tables[Axis::Y] = Some(of_positioning.clone());
        let seen = [
            stops(Axis::X, 1e-4, false),
            stops(Axis::X, 2e-4, false),
            stops(Axis::X, 3e-4, true),
            stops(Axis::Y, 9e-5, false),
        ];
        let of_stops = tables_of_stops(&seen, &mut measured);
        assert_eq!(of_stops, AxisSet::EMPTY.with(Axis::X));
        let x = measured.tables[Axis::X].as_ref().unwrap();
        assert_eq!(x.position.len(), 10);
        assert!((x.deviation_up[9] - 0.027).abs() < 1e-15);
        assert_eq!(measured.tables[Axis::Y], Some(of_positioning));
        assert!(measured.tables[Axis::Z].is_none());
    }
}
