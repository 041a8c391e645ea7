//! Questions to an agent, in HTTP 1.1 without encryption, as agents speak it.

use std::time::Duration;

use http_body_util::{BodyExt, Empty, LengthLimitError, Limited};
use hyper::body::{Bytes, Incoming};
use hyper::client::conn::http1;
use hyper::{Request, Response};
use hyper_util::rt::TokioIo;
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::error::BridgeError;
use crate::multipart::PART_LIMIT;

/// A whole answer must be there after this time; the stage has a limit of its own.
const ANSWER_LIMIT: Duration = Duration::from_secs(60);
/// An answer that a person waits for must be there whole after this time, however slowly it comes.
const FETCH_LIMIT: Duration = Duration::from_secs(10);
/// The head of an answer must be there after this time.
const HEAD_LIMIT: Duration = Duration::from_secs(10);

/// An answer that does not end.
pub struct Stream {
    /// HTTP status.
    pub status: u16,
    /// Value of `Content-Type`; empty: none.
    pub content_type: String,
    body: Incoming,
}

impl Stream {
    /// The next bytes; `None` at the end.
    pub async fn next(&mut self) -> Option<Result<Vec<u8>, String>> {
        loop {
            match self.body.frame().await? {
                Ok(frame) => {
                    // Trailers are of no use here.
                    if let Ok(bytes) = frame.into_data() {
                        return Some(Ok(bytes.to_vec()));
                    }
                }
                Err(error) => return Some(Err(error.to_string())),
            }
        }
    }
}

async fn ask(address: &str, path: &str) -> Result<Response<Incoming>, String> {
    let socket = TcpStream::connect(address).await;
    let socket = TokioIo::new(socket.map_err(|error| error.to_string())?);
    let (mut sender, connection) = http1::handshake(socket)
        .await
        .map_err(|error| error.to_string())?;
    // It ends with the answer's body; what it has to say is told by the body as well.
    tokio::spawn(async move {
        let _ = connection.await;
    });
    let request = Request::get(path)
        .header("Host", address)
        .header("Accept", "text/xml, multipart/x-mixed-replace")
        .body(Empty::<Bytes>::new())
        .map_err(|error| error.to_string())?;
    sender
        .send_request(request)
        .await
        .map_err(|error| error.to_string())
}

/// Asks for a whole answer: status and body.
///
/// # Errors
/// In words: nobody listens, no answer in time, an answer over the limit.
pub async fn get(address: &str, path: &str) -> Result<(u16, Vec<u8>), String> {
    get_within(address, path, ANSWER_LIMIT).await
}

async fn get_within(address: &str, path: &str, limit: Duration) -> Result<(u16, Vec<u8>), String> {
    let whole = async {
        let answer = ask(address, path).await?;
        let status = answer.status().as_u16();
        let body = Limited::new(answer.into_body(), PART_LIMIT).collect().await;
        let body = body.map_err(|error| match error.is::<LengthLimitError>() {
            true => format!("an answer above {PART_LIMIT} bytes: ask for one device (agent.device, or /DEVICE/probe)"),
            false => error.to_string(),
        })?;
        Ok((status, body.to_bytes().to_vec()))
    };
    let answer = timeout(limit, whole).await;
    answer.unwrap_or_else(|_| {
        let limit_s = limit.as_secs_f64();
        Err(format!("no whole answer within {limit_s} s"))
    })
}

/// Asks for an answer that does not end.
///
/// # Errors
/// As [`get`].
pub async fn stream(address: &str, path: &str) -> Result<Stream, String> {
    let answer = timeout(HEAD_LIMIT, ask(address, path)).await;
    let answer = answer.unwrap_or_else(|_| Err("no answer in time".to_owned()))?;
    let content_type = answer.headers().get("content-type");
    let content_type = content_type.and_then(|value| value.to_str().ok());
    Ok(Stream {
        status: answer.status().as_u16(),
        content_type: content_type.unwrap_or_default().to_owned(),
        body: answer.into_body(),
    })
}

/// The body of an answer to `http://host:port/path`, for a program that has no event loop; it takes 10 s at most.
///
/// # Errors
/// When the address is none, nobody answers whole in time, or the system has no event loop left.
pub fn fetch(url: &str) -> Result<Vec<u8>, BridgeError> {
    fetch_within(url, FETCH_LIMIT)
}

fn fetch_within(url: &str, limit: Duration) -> Result<Vec<u8>, BridgeError> {
    let failed = |reason: String| BridgeError::Ask {
        url: url.to_owned(),
        reason,
    };
    let plain = url.strip_prefix("http://");
    let plain = plain.ok_or_else(|| failed(format!("must begin with http://; {PROBE}")))?;
    let (host, path) = plain.split_once('/').unwrap_or((plain, ""));
    let address = if host.contains(':') {
        host.to_owned()
    } else {
        format!("{host}:80")
    };
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|source| BridgeError::Io {
            action: "starting the event loop",
            source,
        })?;
    let answer = runtime.block_on(get_within(&address, &format!("/{path}"), limit));
    // A name that is still being looked up is not awaited.
    runtime.shutdown_background();
    let (status, body) = answer.map_err(|reason| failed(format!("{reason}; {REACH}")))?;
    if status == 200 {
        Ok(body)
    } else {
        Err(failed(format!(
            "HTTP status {status}: must be 200; {PROBE}"
        )))
    }
}

/// What to do where nobody answers.
const REACH: &str = "name the host and port where the agent listens (usually 5000), and start it";
/// What to do where something else answers.
const PROBE: &str = "name the agent's probe document, http://HOST:PORT/probe";

#[cfg(test)]
mod tests {
    use std::io::{Read as _, Write as _};
    use std::net::{TcpListener, TcpStream};
    use std::thread::JoinHandle;

    use super::*;

    /// An agent on loopback: its port, and the first connection to it after its request was read.
    fn agent(answer: impl FnOnce(TcpStream) + Send + 'static) -> (u16, JoinHandle<()>) {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let thread = std::thread::spawn(move || {
            let (mut socket, _) = listener.accept().unwrap();
            assert!(socket.read(&mut [0_u8; 512]).unwrap() > 0);
            answer(socket);
        });
        (port, thread)
    }

    #[test]
    fn an_answer_over_the_limit_is_refused_with_what_to_ask_for() {
        let (port, agent) = agent(|mut socket| {
            let length = PART_LIMIT + 1;
            let head = format!("HTTP/1.1 200 OK\r\nContent-Length: {length}\r\n\r\n");
            socket.write_all(head.as_bytes()).unwrap();
            // Nobody reads it to its end.
            let _ = socket.write_all(&vec![b' '; length]);
        });
        let refused = fetch(&format!("http://127.0.0.1:{port}/probe")).unwrap_err();
        let words = refused.to_string();
        assert!(
            words.contains("an answer above 4194304 bytes: ask for one device"),
            "{words}"
        );
        agent.join().unwrap();
    }

    /// It sends a byte now and then and never ends; the answer is given up by the limit and not by the agent.
    #[test]
    fn an_agent_that_trickles_is_given_up_with_the_limit() {
        let (port, agent) = agent(|mut socket| {
            let head = b"HTTP/1.1 200 OK\r\nContent-Length: 1000000\r\n\r\n";
            socket.write_all(head).unwrap();
            let pause = Some(Duration::from_millis(5));
            socket.set_read_timeout(pause).unwrap();
            // It ends when nobody listens any more.
            while socket.write_all(b" ").is_ok() {
                if socket.read(&mut [0_u8; 512]).is_ok_and(|n| n == 0) {
                    break;
                }
            }
        });
        let url = format!("http://127.0.0.1:{port}/probe");
        let refused = fetch_within(&url, Duration::from_millis(250)).unwrap_err();
        let words = refused.to_string();
        assert!(words.contains("no whole answer within 0.25 s"), "{words}");
        agent.join().unwrap();
        assert_eq!(FETCH_LIMIT, Duration::from_secs(10));
    }
}
