//! The bridge's sockets: the only part that does something itself.
//!
//! One thread carries out what the stage asks for and stamps what comes with the host's clock. What comes waits
//! in a queue of bounded length; when it is full the thread waits, and so, by TCP, does the machine.

use std::future::pending;
use std::pin::Pin;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use metrology::stamp::{Host, Stamp};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::timeout;

use crate::error::BridgeError;
use crate::stage::{IoCommand, IoEvent};

pub mod http;
mod log_file;

use http::Stream;
pub use log_file::LogFile;

/// An attempt to connect ends after this time.
const CONNECT_LIMIT: Duration = Duration::from_secs(3);
/// A line that the machine does not take within this time ends the connection.
const SEND_LIMIT: Duration = Duration::from_secs(1);
/// Events that wait for the stage at most.
const QUEUE_LENGTH: usize = 1024;
/// Bytes that are read at a time.
const READ_LENGTH: usize = 16384;

/// The host's clock.
#[expect(
    clippy::disallowed_methods,
    reason = "this module stamps what comes from outside"
)]
#[must_use]
pub fn host_now() -> Stamp<Host> {
    let since = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Stamp::from_nanos(i64::try_from(since.as_nanos()).unwrap_or(i64::MAX))
}

type Events = mpsc::SyncSender<(Stamp<Host>, IoEvent)>;

/// The thread that does what the stage wants.
#[derive(Debug)]
pub struct BridgeIo {
    commands: Option<UnboundedSender<IoCommand>>,
    events: Option<mpsc::Receiver<(Stamp<Host>, IoEvent)>>,
    thread: Option<JoinHandle<()>>,
}

impl BridgeIo {
    /// Starts the thread for the adapter or agent at `address`; it does nothing until it is told.
    ///
    /// # Errors
    /// When the system has no thread or no event queue left.
    pub fn start(address: String) -> Result<Self, BridgeError> {
        let failed = |action| move |source| BridgeError::Io { action, source };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(failed("starting the event loop"))?;
        let (commands, command_receiver) = unbounded_channel();
        let (event_sender, events) = mpsc::sync_channel(QUEUE_LENGTH);
        let thread = std::thread::Builder::new()
            .name("mtconnect_io".to_owned())
            .spawn(move || {
                runtime.block_on(Hands::new(address, event_sender).serve(command_receiver));
                // A name that is still being looked up is not awaited.
                runtime.shutdown_background();
            })
            .map_err(failed("starting a thread"))?;
        Ok(Self {
            commands: Some(commands),
            events: Some(events),
            thread: Some(thread),
        })
    }

    /// Hands a wish to the thread.
    pub fn command(&self, command: IoCommand) {
        if let Some(commands) = &self.commands {
            // The receiver lives as long as the thread, and the thread as long as this.
            let _ = commands.send(command);
        }
    }

    /// The next event, when there is one.
    #[must_use]
    pub fn event(&self) -> Option<(Stamp<Host>, IoEvent)> {
        self.events.as_ref()?.try_recv().ok()
    }
}

impl Drop for BridgeIo {
    fn drop(&mut self) {
        self.commands = None;
        // A thread that waits for a place in the queue goes on when there is no queue.
        self.events = None;
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has been printed already.
            let _ = thread.join();
        }
    }
}

/// What an attempt ended in; nothing of it is left when it is dropped.
enum Done {
    Connected(TcpStream),
    Answered { status: u16, body: Vec<u8> },
    Began(Stream),
    Failed(String),
}

type Attempt = Pin<Box<dyn Future<Output = Done>>>;

struct Hands {
    address: String,
    events: Events,
    attempt: Option<Attempt>,
    socket: Option<TcpStream>,
    stream: Option<Stream>,
}

/// What woke the thread.
enum Wake {
    Command(Option<IoCommand>),
    Attempt(Done),
    Socket(std::io::Result<usize>),
    Stream(Option<Result<Vec<u8>, String>>),
}

impl Hands {
    fn new(address: String, events: Events) -> Self {
        Self {
            address,
            events,
            attempt: None,
            socket: None,
            stream: None,
        }
    }

    fn tell(&self, event: IoEvent) {
        // Nobody listens any more only while the bridge is being dropped.
        let _ = self.events.send((host_now(), event));
    }

    async fn serve(mut self, mut commands: UnboundedReceiver<IoCommand>) {
        let mut bytes = vec![0_u8; READ_LENGTH];
        loop {
            let wake = tokio::select! {
                biased;
                command = commands.recv() => Wake::Command(command),
                done = ended(self.attempt.as_mut()) => Wake::Attempt(done),
                read = read_socket(self.socket.as_mut(), &mut bytes) => Wake::Socket(read),
                chunk = read_stream(self.stream.as_mut()) => Wake::Stream(chunk),
            };
            match wake {
                Wake::Command(None) => break,
                Wake::Command(Some(command)) => self.act(command).await,
                Wake::Attempt(done) => self.done(done),
                Wake::Socket(Ok(0)) => self.close("end of stream".to_owned()),
                Wake::Socket(Ok(length)) => {
                    self.tell(IoEvent::Received(bytes[..length].to_vec()));
                }
                Wake::Socket(Err(error)) => self.close(error.to_string()),
                Wake::Stream(Some(Ok(chunk))) => self.tell(IoEvent::Received(chunk)),
                Wake::Stream(Some(Err(reason))) => self.close(reason),
                Wake::Stream(None) => self.close("end of stream".to_owned()),
            }
        }
    }

    fn close(&mut self, reason: String) {
        let status = self.stream.take().map_or(0, |stream| stream.status);
        self.socket = None;
        self.tell(IoEvent::Closed { reason, status });
    }

    fn done(&mut self, done: Done) {
        self.attempt = None;
        let event = match done {
            Done::Connected(socket) => {
                self.socket = Some(socket);
                IoEvent::Connected
            }
            Done::Answered { status, body } => IoEvent::Answered { status, body },
            Done::Began(stream) => {
                let content_type = stream.content_type.clone();
                self.stream = Some(stream);
                IoEvent::Began { content_type }
            }
            Done::Failed(reason) => IoEvent::NotConnected { reason },
        };
        self.tell(event);
    }

    async fn act(&mut self, command: IoCommand) {
        let address = self.address.clone();
        match command {
            IoCommand::Connect => self.attempt = Some(Box::pin(connected(address))),
            IoCommand::Disconnect => {
                (self.attempt, self.socket, self.stream) = (None, None, None);
            }
            IoCommand::Send(line) => self.send(&line).await,
            IoCommand::Get { path } => {
                self.attempt = Some(Box::pin(async move {
                    match http::get(&address, &path).await {
                        Ok((status, body)) => Done::Answered { status, body },
                        Err(reason) => Done::Failed(reason),
                    }
                }));
            }
            IoCommand::Stream { path } => {
                self.attempt = Some(Box::pin(async move {
                    let began = http::stream(&address, &path).await;
                    began.map_or_else(Done::Failed, Done::Began)
                }));
            }
        }
    }

    async fn send(&mut self, line: &str) {
        if let Some(socket) = &mut self.socket {
            let sent = timeout(SEND_LIMIT, socket.write_all(line.as_bytes())).await;
            match sent {
                Ok(Ok(())) => {}
                Ok(Err(error)) => self.close(error.to_string()),
                Err(_) => self.close("it takes no line".to_owned()),
            }
        }
    }
}

async fn connected(address: String) -> Done {
    match timeout(CONNECT_LIMIT, TcpStream::connect(&address)).await {
        Ok(Ok(socket)) => Done::Connected(socket),
        Ok(Err(error)) => Done::Failed(error.to_string()),
        Err(_) => Done::Failed("no answer in time".to_owned()),
    }
}

async fn ended(attempt: Option<&mut Attempt>) -> Done {
    match attempt {
        Some(attempt) => attempt.await,
        None => pending().await,
    }
}

async fn read_socket(socket: Option<&mut TcpStream>, bytes: &mut [u8]) -> std::io::Result<usize> {
    match socket {
        Some(socket) => socket.read(bytes).await,
        None => pending().await,
    }
}

async fn read_stream(stream: Option<&mut Stream>) -> Option<Result<Vec<u8>, String>> {
    match stream {
        Some(stream) => stream.next().await,
        None => pending().await,
    }
}
