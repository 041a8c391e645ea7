//! Alarms to whoever asked for them: a JSON POST over plain HTTP 1.1, again after growing pauses, within a stated time.

use std::time::Duration;

use http_body_util::Full;
use hyper::Request;
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper_util::rt::TokioIo;
use reports::evaluate::limits::webhook::Webhook;
use tokio::net::TcpStream;
use tokio::time::{sleep, timeout};

/// How often and how long a receiver is asked.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// Attempts, one at least.
    pub attempts: u32,
    /// Longest time of an attempt.
    pub attempt: Duration,
    /// Pause after the first attempt; each further one is twice as long.
    pub first_pause: Duration,
}

impl Default for Patience {
    /// Four attempts of at most 5 s, after pauses of 1, 2 and 4 s: 27 s at most.
    fn default() -> Self {
        Self {
            attempts: 4,
            attempt: Duration::from_secs(5),
            first_pause: Duration::from_secs(1),
        }
    }
}

/// Why an attempt failed.
enum Refusal {
    /// The next one may succeed.
    Again(String),
    /// No further one would.
    Final(String),
}

/// Sends `body` until it is taken; how many attempts that took. `id` is the same in all of them, so that a receiver knows
/// one that came twice.
///
/// # Errors
/// In words: why the receiver did not take it, and after how many attempts.
pub fn post(to: &Webhook, id: &str, body: &str, patience: Patience) -> Result<u32, String> {
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| format!("no event loop: {error}"))?;
    let sent = runtime.block_on(attempts(to, id, body, patience));
    // A name that is still being looked up is not awaited.
    runtime.shutdown_background();
    sent
}

async fn attempts(to: &Webhook, id: &str, body: &str, patience: Patience) -> Result<u32, String> {
    let mut pause = patience.first_pause;
    let mut attempt = 1;
    loop {
        let limit_s = patience.attempt.as_secs_f64();
        let answer = timeout(patience.attempt, attempt_once(to, id, body)).await;
        let late = || Err(Refusal::Again(format!("no answer within {limit_s} s")));
        match answer.unwrap_or_else(|_| late()) {
            Ok(()) => return Ok(attempt),
            Err(Refusal::Again(reason)) if attempt >= patience.attempts => {
                return Err(format!("{reason} ({attempt} attempts)"));
            }
            Err(Refusal::Again(_)) => {}
            Err(Refusal::Final(reason)) => return Err(reason),
        }
        sleep(pause).await;
        pause = pause.saturating_mul(2);
        attempt += 1;
    }
}

async fn attempt_once(to: &Webhook, id: &str, body: &str) -> Result<(), Refusal> {
    let again = |error: &dyn std::fmt::Display| Refusal::Again(error.to_string());
    let socket = TcpStream::connect(&to.address)
        .await
        .map_err(|error| again(&error))?;
    let (mut sender, connection) = http1::handshake(TokioIo::new(socket))
        .await
        .map_err(|error| again(&error))?;
    // It ends with the sender; what it reports, the answer does too.
    tokio::spawn(async move {
        let _ = connection.await;
    });
    let request = Request::post(&to.path)
        .header("Host", &to.host)
        .header("Content-Type", "application/json")
        .header("Idempotency-Key", id)
        .header("User-Agent", concat!("abbe/", env!("CARGO_PKG_VERSION")))
        .body(Full::new(Bytes::copy_from_slice(body.as_bytes())))
        .map_err(|error| Refusal::Final(error.to_string()))?;
    let answer = sender
        .send_request(request)
        .await
        .map_err(|error| again(&error))?;
    judged(answer.status().as_u16())
}

/// What an HTTP status means: 2xx is taken, 408, 425, 429 and 5xx may change.
fn judged(status: u16) -> Result<(), Refusal> {
    match status {
        200..=299 => Ok(()),
        408 | 425 | 429 | 500.. => Err(Refusal::Again(format!("HTTP status {status}"))),
        300..=399 => Err(Refusal::Final(format!(
            "HTTP status {status}: redirections are not followed, name the place that takes the alarm"
        ))),
        _ => Err(Refusal::Final(format!(
            "HTTP status {status}: the receiver does not take it, check the path"
        ))),
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::TcpListener;
    use std::thread::JoinHandle;

    use super::*;

    const HASTE: Patience = Patience {
        attempts: 3,
        attempt: Duration::from_secs(5),
        first_pause: Duration::from_millis(1),
    };

    /// A receiver on loopback that gives these answers, one a connection (empty: none); the requests that it had.
    fn receiver(answers: &'static [&'static str]) -> (Webhook, JoinHandle<Vec<String>>) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let thread = std::thread::spawn(move || {
            let of = |answer: &&str| {
                let (mut socket, _) = listener.accept().unwrap();
                let mut request = Vec::new();
                let mut part = [0_u8; 512];
                while !request.ends_with(b"}") {
                    let n = socket.read(&mut part).unwrap();
                    assert!(n > 0, "the request ended early");
                    request.extend(&part[..n]);
                }
                socket.write_all(answer.as_bytes()).unwrap();
                String::from_utf8(request).unwrap()
            };
            answers.iter().map(of).collect()
        });
        let url = format!("http://127.0.0.1:{port}/alarm?cell=3");
        (Webhook::read(&url).unwrap(), thread)
    }

    #[test]
    fn an_alarm_is_sent_again_until_it_is_taken_with_the_same_id() {
        let answers = &[
            "",
            "HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n",
            "HTTP/1.1 204 Taken\r\n\r\n",
        ];
        let (to, receiver) = receiver(answers);
        assert_eq!(post(&to, "77", r#"{"a":1}"#, HASTE), Ok(3));
        let requests = receiver.join().unwrap();
        assert_eq!(requests.len(), 3);
        for request in requests {
            assert!(
                request.starts_with("POST /alarm?cell=3 HTTP/1.1\r\n"),
                "{request}"
            );
            assert!(
                request.to_lowercase().contains("idempotency-key: 77\r\n"),
                "{request}"
            );
            assert!(request.ends_with("\r\n\r\n{\"a\":1}"), "{request}");
        }
    }

    #[test]
    fn a_receiver_that_does_not_take_it_is_named_with_status_and_attempts() {
        for (answers, words) in [
            (
                &["HTTP/1.1 404 No\r\nContent-Length: 0\r\n\r\n"][..],
                "HTTP status 404",
            ),
            (
                &["HTTP/1.1 302 There\r\nLocation: /x\r\nContent-Length: 0\r\n\r\n"],
                "redirections are not followed",
            ),
            (
                &["HTTP/1.1 500 Oh\r\nContent-Length: 0\r\n\r\n"; 3],
                "HTTP status 500 (3 attempts)",
            ),
        ] {
            let (to, receiver) = receiver(answers);
            let refused = post(&to, "1", "{}", HASTE).unwrap_err();
            assert!(refused.contains(words), "{refused}");
            assert_eq!(receiver.join().unwrap().len(), answers.len());
        }
    }

    #[test]
    fn a_receiver_that_is_silent_is_given_up_with_the_limit() {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let to = Webhook::read(&format!("http://127.0.0.1:{port}/")).unwrap();
        let short = Patience {
            attempts: 2,
            attempt: Duration::from_millis(50),
            ..HASTE
        };
        let refused = post(&to, "1", "{}", short).unwrap_err();
        assert_eq!(refused, "no answer within 0.05 s (2 attempts)");
        drop(listener);
        let gone = post(&to, "1", "{}", HASTE).unwrap_err();
        assert!(gone.ends_with("(3 attempts)"), "{gone}");
    }

    #[test]
    fn the_usual_patience_ends_within_30_s() {
        let Patience {
            attempts,
            attempt,
            first_pause,
        } = Patience::default();
        let pauses = (0..attempts - 1).map(|n| first_pause * 2_u32.pow(n));
        let most: Duration = pauses.sum::<Duration>() + attempt * attempts;
        assert_eq!(most, Duration::from_secs(27));
    }
}
