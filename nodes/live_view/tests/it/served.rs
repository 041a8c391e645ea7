//! The server over loopback, asked by hand.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use live_view::io::{LiveViewIo, Source};
use live_view::{Condition, Input, LiveViewConfig, LiveViewStage, Settings};
use metrology::Stamp;
use serde_json::Value;

const TOKEN: &str = "0123456789abcdef0123456789abcdef";
/// Far above what anything here takes.
const LONG: Duration = Duration::from_secs(60);

fn config() -> LiveViewConfig {
    LiveViewConfig {
        address: "127.0.0.1:0".to_owned(),
        rate_hz: 20.0,
        request_timeout_s: 0.3,
        stall_timeout_s: 0.3,
        ..LiveViewConfig::default()
    }
}

/// A page on which so many conditions have another text, of so many letters, at each look.
fn changing(conditions: usize, letters: usize) -> Source {
    let looks = Arc::new(AtomicI64::new(0));
    Box::new(move |out| {
        let n = looks.fetch_add(1, Ordering::Relaxed);
        let now = Stamp::from_nanos(n * 50_000_000);
        let input = |one: usize| {
            Input::Condition(Condition {
                name: format!("/x: {one}"),
                level: 1,
                message: format!("{n} {}", "x".repeat(letters)),
            })
        };
        out.extend((0..conditions).map(|one| (now, input(one))));
        now
    })
}

fn serve(config: &LiveViewConfig, token: Option<&str>, source: Source) -> LiveViewIo {
    let settings = Settings::new(config).unwrap();
    let stage = LiveViewStage::new(settings.stale_after(), Default::default());
    LiveViewIo::start(&settings, token.map(str::to_owned), stage, source).unwrap()
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.set_write_timeout(Some(LONG)).unwrap();
    stream
}

/// Sends bytes and reads until the server closes; a connection that it resets ends what is read.
fn send(address: SocketAddr, bytes: &[u8]) -> String {
    let mut stream = connect(address);
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let mut buffer = [0; 4096];
    while let Ok(n @ 1..) = stream.read(&mut buffer) {
        answer.extend_from_slice(&buffer[..n]);
    }
    String::from_utf8_lossy(&answer).into_owned()
}

/// Status of a request with these lines behind the first.
fn status(address: SocketAddr, first: &str, lines: &[&str]) -> u16 {
    let request = format!("{first} HTTP/1.1\r\n{}\r\n\r\n", lines.join("\r\n"));
    let answer = send(address, request.as_bytes());
    let status = answer.split(' ').nth(1).map(str::parse);
    status
        .unwrap_or_else(|| panic!("no answer to {first}: {answer}"))
        .unwrap()
}

/// A browser that has asked for events and read their head.
fn browser(address: SocketAddr) -> (TcpStream, String) {
    let mut stream = connect(address);
    stream
        .write_all(b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n")
        .unwrap();
    let mut head = Vec::new();
    while !head.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        stream.read_exact(&mut byte).unwrap();
        head.push(byte[0]);
    }
    (stream, String::from_utf8(head).unwrap())
}

/// Waits until a condition holds; a test that waits for ever fails by its runner's limit.
fn until(mut holds: impl FnMut() -> bool) {
    while !holds() {
        std::thread::yield_now();
    }
}

#[test]
fn the_page_is_one_document_that_may_ask_nobody_but_its_server() {
    let io = serve(&config(), None, changing(1, 1));
    let answer = send(io.address(), b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    let (head, html) = answer.split_once("\r\n\r\n").unwrap();
    let head = head.to_ascii_lowercase();
    for line in [
        "http/1.1 200",
        "content-security-policy: default-src 'none'; script-src 'sha256-",
        "x-frame-options: deny",
        "x-content-type-options: nosniff",
        "referrer-policy: no-referrer",
        "cache-control: no-store",
    ] {
        assert!(head.contains(line), "{line}: {head}");
    }
    assert!(!head.contains("access-control"), "{head}");
    assert!(html.contains("new EventSource") && html.contains("prefers-color-scheme"));
    for outside in ["http://", "https://", "src=", "@import", "innerHTML"] {
        assert!(!html.contains(outside), "{outside}");
    }
}

#[test]
fn the_snapshot_has_the_parts_and_the_events_the_changes() {
    let io = serve(&config(), None, changing(2, 1));
    let address = io.address();
    until(|| {
        let answer = send(
            address,
            b"GET /snapshot.json HTTP/1.1\r\nHost: localhost\r\n\r\n",
        );
        let json: Value = serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap();
        let conditions = json["parts"]["conditions"].as_array();
        conditions.is_some_and(|all| all.len() == 2)
    });
    let (mut stream, head) = browser(address);
    assert!(head.contains("text/event-stream"), "{head}");
    let mut text = String::new();
    until(|| {
        let mut buffer = [0; 4096];
        let n = stream.read(&mut buffer).unwrap();
        text.push_str(&String::from_utf8_lossy(&buffer[..n]));
        text.matches("data: {\"now_ms\":").count() >= 3
    });
    assert_eq!(io.account().browsers, 1);
    drop(stream);
    until(|| io.account().browsers == 0);
}

#[test]
fn other_names_are_refused() {
    let mut config = config();
    config.host_names = vec!["Mill-3.example".to_owned()];
    let io = serve(&config, None, changing(1, 1));
    let ask = |lines: &[&str]| status(io.address(), "GET /snapshot.json", lines);
    for host in [
        "localhost",
        "127.0.0.1:80",
        "[::1]:9",
        "192.168.1.5",
        "mill-3.EXAMPLE:8642",
    ] {
        assert_eq!(ask(&[&format!("Host: {host}")]), 200, "{host}");
    }
    for host in [
        "evil.example",
        "localhost.evil.example",
        "a@127.0.0.1",
        "",
        "127.0.0.1.evil.example",
    ] {
        let answer = ask(&[&format!("Host: {host}")]);
        assert!(answer == 421 || answer == 400, "{host}: {answer}");
    }
    assert_eq!(ask(&["Host: localhost", "Host: evil.example"]), 421);
    let absolute = status(
        io.address(),
        "GET http://evil.example/snapshot.json",
        &["Host: localhost"],
    );
    assert_eq!(absolute, 421);
    assert!(io.account().refused["refused_host_name"] >= 5);
}

#[test]
fn other_sites_and_bodies_are_refused_and_counted() {
    let io = serve(&config(), None, changing(1, 1));
    let ask = |lines: &[&str]| status(io.address(), "GET /snapshot.json", lines);
    for line in [
        "Origin: http://evil.example",
        "Origin: null",
        "Sec-Fetch-Site: cross-site",
        "Sec-Fetch-Site: same-site",
        "Sec-Fetch-Site: cross-site\r\nSec-Fetch-Mode: navigate\r\nSec-Fetch-Dest: document",
    ] {
        assert_eq!(ask(&["Host: localhost", line]), 403, "{line}");
    }
    let own = [
        "Host: localhost:5",
        "Origin: http://localhost:5",
        "Sec-Fetch-Site: same-origin",
    ];
    assert_eq!(ask(&own), 200);
    let link = [
        "Host: localhost",
        "Sec-Fetch-Site: cross-site",
        "Sec-Fetch-Mode: navigate",
        "Sec-Fetch-Dest: document",
    ];
    assert_eq!(status(io.address(), "GET /", &link), 200);
    assert_eq!(ask(&["Host: localhost", "Content-Length: 5"]), 413);
    assert_eq!(ask(&["Host: localhost", "Transfer-Encoding: chunked"]), 413);
    assert_eq!(
        status(io.address(), "POST /snapshot.json", &["Host: localhost"]),
        405
    );
    assert_eq!(
        status(io.address(), "GET /other", &["Host: localhost"]),
        404
    );
    let refused = io.account().refused;
    assert_eq!(refused["refused_cross_site"], 5);
    assert_eq!(refused["refused_body"], 2);
}

#[test]
fn a_token_is_asked_for_and_only_the_right_one_lets_in() {
    let io = serve(&config(), Some(TOKEN), changing(1, 1));
    let ask = |first: &str, line: &str| status(io.address(), first, &["Host: localhost", line]);
    for path in ["/", "/snapshot.json", "/events", "/other"] {
        assert_eq!(ask(&format!("GET {path}"), "X: y"), 401, "{path}");
    }
    let snapshot = "GET /snapshot.json";
    assert_eq!(
        ask(snapshot, &format!("Authorization: Bearer {TOKEN}")),
        200
    );
    assert_eq!(ask(&format!("{snapshot}?a=b&token={TOKEN}"), "X: y"), 200);
    let longer = format!("{TOKEN}0");
    for wrong in ["", &TOKEN[1..], &longer, "x"] {
        assert_eq!(
            ask(snapshot, &format!("Authorization: Bearer {wrong}")),
            401,
            "{wrong}"
        );
        assert_eq!(
            ask(&format!("{snapshot}?token={wrong}"), "X: y"),
            401,
            "{wrong}"
        );
    }
    // What stands in the header counts.
    let both = ask(
        &format!("{snapshot}?token={TOKEN}"),
        "Authorization: Bearer x",
    );
    assert_eq!(both, 401);
    assert_eq!(io.account().refused["refused_token"], 13);
}

#[test]
fn long_heads_are_refused_and_slow_ones_ended_while_others_are_served() {
    let io = serve(&config(), None, changing(1, 1));
    let address = io.address();
    let long = format!("X: {}", "x".repeat(1 << 20));
    assert_eq!(status(address, "GET /", &["Host: localhost", &long]), 431);
    let many: Vec<String> = (0..100).map(|n| format!("X{n}: y")).collect();
    let many: Vec<&str> = many.iter().map(String::as_str).collect();
    assert_eq!(status(address, "GET /", &many), 431);
    let mut slow: Vec<TcpStream> = (0..30).map(|_| connect(address)).collect();
    for stream in &mut slow {
        stream.write_all(b"GET / HTTP/1.1\r\nHost: loc").unwrap();
    }
    assert_eq!(status(address, "GET /", &["Host: localhost"]), 200);
    for mut stream in slow {
        // Ended by the server, with or without a word.
        let _ = stream.read_to_end(&mut Vec::new());
    }
    assert_eq!(status(address, "GET /", &["Host: localhost"]), 200);
    assert!(!send(address, b"\x16\x03\x01\0nonsense\r\n\r\n").contains("200 OK"));
}

#[test]
fn one_browser_more_than_may_be_is_refused_until_another_goes() {
    let config = LiveViewConfig {
        most_browsers: 3,
        stall_timeout_s: 600.0,
        ..config()
    };
    let io = serve(&config, None, changing(1, 1));
    let mut all: Vec<_> = (0..3).map(|_| browser(io.address()).0).collect();
    assert_eq!(io.account().browsers, 3);
    let (_, head) = browser(io.address());
    assert!(head.starts_with("HTTP/1.1 503"), "{head}");
    assert!(
        head.to_ascii_lowercase().contains("retry-after: 10"),
        "{head}"
    );
    assert_eq!(io.account().refused["refused_too_many"], 1);
    drop(all.pop());
    until(|| io.account().browsers == 2);
    let (_stream, head) = browser(io.address());
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
}

#[test]
fn twenty_browsers_that_stall_are_dropped_while_another_goes_on() {
    let config = LiveViewConfig {
        most_browsers: 21,
        ..config()
    };
    // 200 kB at each look: what waits in the system for a browser that takes nothing is soon full.
    let io = serve(&config, None, changing(200, 900));
    let (mut reader, _) = browser(io.address());
    let stalled: Vec<_> = (0..20).map(|_| browser(io.address())).collect();
    let mut buffer = [0; 65536];
    until(|| {
        assert!(
            reader.read(&mut buffer).unwrap() > 0,
            "the one that reads was dropped"
        );
        io.account().browsers == 1
    });
    drop(stalled);
}

#[test]
fn an_address_that_is_taken_is_refused_with_the_remedy() {
    let io = serve(&config(), None, changing(1, 1));
    let second = LiveViewConfig {
        address: io.address().to_string(),
        ..config()
    };
    let settings = Settings::new(&second).unwrap();
    let stage = LiveViewStage::new(settings.stale_after(), Default::default());
    let Err(error) = LiveViewIo::start(&settings, None, stage, changing(1, 1)) else {
        panic!("two servers at {}", io.address());
    };
    assert!(error.to_string().contains("use another port"), "{error}");
}
