//! A node's log level, set by service while it runs.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use abbe_msgs::rcl_interfaces::msg::{Log, LoggerLevel};
use abbe_msgs::rcl_interfaces::srv::{
    GetLoggerLevels, GetLoggerLevelsRequest, GetLoggerLevelsResponse, SetLoggerLevels,
    SetLoggerLevelsRequest, SetLoggerLevelsResponse,
};
use abbe_msgs::{Message, from_cdr, to_cdr, topics};
use metrology::stamp::Span;
use node_runtime::node::Ports;
use node_runtime::{Bytes, Emission, Event};

use super::puppet::{Puppet, environment, service, start, start_with, topic, wait};

fn bytes<M: Message>(message: &M) -> Bytes {
    Arc::from(to_cdr(message))
}

/// Says one line of each of three levels ten times a second.
fn chatterer(name: &str) -> Puppet {
    let ports = Ports {
        timers: vec![Span::from_nanos(100_000_000)],
        ..Ports::default()
    };
    Puppet::new(name, ports, |_, event, _| {
        if matches!(event, Event::Timer { .. }) {
            tracing::debug!("whisper");
            tracing::info!("word");
            tracing::error!("shout");
        }
        Ok(())
    })
}

enum Heard {
    Line(Log),
    Levels(Vec<u32>),
    Set(Vec<bool>),
}

/// Hears every line, and asks what the test wants asked.
fn listener(heard: Sender<Heard>, wanted: Receiver<Emission>) -> Puppet {
    let ports = Ports {
        subscriptions: vec![topic::<Log>(topics::ROSOUT.name, topics::ROSOUT.qos)],
        clients: vec![
            service::<SetLoggerLevels>("/loud/set_logger_levels"),
            service::<GetLoggerLevels>("/loud/get_logger_levels"),
        ],
        timers: vec![Span::from_nanos(10_000_000)],
        ..Ports::default()
    };
    Puppet::new("listener", ports, move |_, event, out| {
        let news = match event {
            Event::Timer { .. } => {
                out.extend(wanted.try_iter());
                return Ok(());
            }
            Event::Message { bytes, .. } => Heard::Line(from_cdr(bytes).unwrap()),
            Event::Response {
                client: 0, bytes, ..
            } => {
                let response: SetLoggerLevelsResponse = from_cdr(bytes.unwrap()).unwrap();
                Heard::Set(response.results.iter().map(|r| r.successful).collect())
            }
            Event::Response { bytes, .. } => {
                let response: GetLoggerLevelsResponse = from_cdr(bytes.unwrap()).unwrap();
                Heard::Levels(response.levels.iter().map(|l| l.level).collect())
            }
            _ => return Ok(()),
        };
        let _ = heard.send(news);
        Ok(())
    })
}

fn setting(level: u32) -> Emission {
    let levels = vec![LoggerLevel {
        name: "loud".to_owned(),
        level,
    }];
    Emission::Call {
        client: 0,
        id: u64::from(level),
        bytes: bytes(&SetLoggerLevelsRequest { levels }),
    }
}

/// Lines of `name` until `count` shouts of its, which are said at every level but fatal.
fn lines(heard: &Receiver<Heard>, name: &str, count: usize) -> Vec<String> {
    let (mut said, mut shouts) = (Vec::new(), 0);
    wait(heard, "lines", |news| {
        let Heard::Line(line) = news else { return None };
        if line.name == name {
            shouts += usize::from(line.msg == "shout");
            said.push(line.msg);
        }
        (shouts == count).then_some(())
    });
    said
}

#[test]
fn a_level_set_by_service_holds_for_that_node_alone_until_it_is_taken_back() {
    let environment = environment(17);
    let (sender, heard) = channel();
    let (ask, wanted) = channel();
    let listening = start(&environment, listener(sender, wanted));
    let loud = start(&environment, chatterer("loud"));
    let quiet = ["--ros-args", "--log-level", "quiet:=error"];
    let quiet = start_with(&environment, chatterer("quiet"), &quiet);
    assert!(!lines(&heard, "loud", 5).contains(&"whisper".to_owned()));

    let set = |level| {
        ask.send(setting(level)).unwrap();
        wait(&heard, "the answer", |news| match news {
            Heard::Set(results) => Some(results),
            _ => None,
        })
    };
    assert_eq!(set(10), [true]);
    let names = vec!["loud".to_owned(), "quiet".to_owned()];
    ask.send(Emission::Call {
        client: 1,
        id: 1,
        bytes: bytes(&GetLoggerLevelsRequest { names }),
    })
    .unwrap();
    let levels = wait(&heard, "levels", |news| match news {
        Heard::Levels(levels) => Some(levels),
        _ => None,
    });
    assert_eq!(levels, [10, 0]);
    assert!(lines(&heard, "loud", 5).contains(&"whisper".to_owned()));
    assert!(!lines(&heard, "quiet", 5).contains(&"whisper".to_owned()));

    assert_eq!(set(40), [true]);
    // What was said before the answer may come after it.
    lines(&heard, "loud", 3);
    assert_eq!(lines(&heard, "loud", 5), ["shout"; 5]);

    assert_eq!(set(0), [true]);
    lines(&heard, "loud", 3);
    let said = lines(&heard, "loud", 5);
    assert!(said.contains(&"word".to_owned()), "{said:?}");
    assert!(!said.contains(&"whisper".to_owned()), "{said:?}");
    for running in [loud, quiet, listening] {
        running.stop().unwrap();
    }
}
