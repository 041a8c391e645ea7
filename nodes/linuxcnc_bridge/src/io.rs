//! The bridge's sockets, processes and files: the only part that does something itself.
//!
//! One thread carries out what the stage asks for and stamps what comes back with the host's clock:
//! the TCP connection to `linuxcncrsh`, one `halsampler` that reads records, one lasting `halcmd`
//! that sets signals, and the files of programs.

use std::io;
use std::path::PathBuf;
use std::process::Stdio;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use metrology::stamp::{Host, Stamp};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tokio::io::{AsyncBufReadExt, AsyncReadExt, AsyncWriteExt, BufReader, Lines};
use tokio::net::TcpStream;
use tokio::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command};
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::{Instant, sleep_until, timeout};

use crate::error::BridgeError;
use crate::stage::{IoCommand, IoEvent};

pub mod account;
mod remains;
pub mod start;

use account::Account;

/// An attempt to connect ends after this time.
const CONNECT_LIMIT: Duration = Duration::from_secs(2);
/// A process that was asked to end is killed after this time.
const KILL_LIMIT: Duration = Duration::from_secs(2);
/// Old records are thrown away for this long before the sampler is switched on.
const DRAIN_TIME: Duration = Duration::from_millis(150);

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

/// Where the controller is and who owns it.
#[derive(Clone, Debug)]
pub struct Address {
    /// Host of `linuxcncrsh`.
    pub host: String,
    /// Its port.
    pub port: u16,
    /// The user whose HAL it is; programs are put in its home.
    pub account: Account,
}

/// The thread that does what the stage wants.
#[derive(Debug)]
pub struct BridgeIo {
    commands: Option<UnboundedSender<IoCommand>>,
    events: mpsc::Receiver<(Stamp<Host>, IoEvent)>,
    thread: Option<JoinHandle<()>>,
}

impl BridgeIo {
    /// Starts the thread; it does nothing until it is told.
    ///
    /// # Errors
    /// When the system has no thread or no event queue left.
    pub fn start(address: Address) -> Result<Self, BridgeError> {
        let failed = |action| {
            move |source| BridgeError::Io {
                action,
                path: PathBuf::from("linuxcnc_io"),
                source,
            }
        };
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_all()
            .build()
            .map_err(failed("starting the event loop of"))?;
        let (commands, command_receiver) = unbounded_channel();
        let (event_sender, events) = mpsc::channel();
        let thread = std::thread::Builder::new()
            .name("linuxcnc_io".to_owned())
            .spawn(move || {
                runtime.block_on(Hands::new(address, event_sender).serve(command_receiver))
            })
            .map_err(failed("starting thread"))?;
        Ok(Self {
            commands: Some(commands),
            events,
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
    pub fn event(&self) -> Option<(Stamp<Host>, IoEvent)> {
        self.events.try_recv().ok()
    }
}

impl Drop for BridgeIo {
    fn drop(&mut self) {
        self.commands = None;
        if let Some(thread) = self.thread.take() {
            // A panic in the thread has been printed already.
            let _ = thread.join();
        }
    }
}

struct Sampler {
    child: Child,
    stdout: ChildStdout,
    /// Until then old records are thrown away.
    draining: Option<Instant>,
}

struct Hal {
    child: Child,
    stdin: ChildStdin,
    stderr: Lines<BufReader<ChildStderr>>,
}

struct Hands {
    address: Address,
    events: mpsc::Sender<(Stamp<Host>, IoEvent)>,
    socket: Option<TcpStream>,
    sampler: Option<Sampler>,
    hal: Option<Hal>,
}

/// What woke the thread.
enum Wake {
    Command(Option<IoCommand>),
    Socket(io::Result<usize>),
    Sampler(io::Result<usize>),
    Drained,
    Hal(io::Result<Option<String>>),
}

impl Hands {
    fn new(address: Address, events: mpsc::Sender<(Stamp<Host>, IoEvent)>) -> Self {
        Self {
            address,
            events,
            socket: None,
            sampler: None,
            hal: None,
        }
    }

    fn tell(&self, event: IoEvent) {
        // Nobody listens any more only while the bridge is being dropped.
        let _ = self.events.send((host_now(), event));
    }

    async fn serve(mut self, mut commands: UnboundedReceiver<IoCommand>) {
        let mut socket_bytes = vec![0_u8; 4096];
        let mut sample_bytes = vec![0_u8; 65536];
        loop {
            let drained_at = self.sampler.as_ref().and_then(|sampler| sampler.draining);
            let wake = tokio::select! {
                command = commands.recv() => Wake::Command(command),
                read = read_socket(self.socket.as_mut(), &mut socket_bytes) => Wake::Socket(read),
                read = read_sampler(self.sampler.as_mut(), &mut sample_bytes) => Wake::Sampler(read),
                () = wait(drained_at) => Wake::Drained,
                line = read_hal(self.hal.as_mut()) => Wake::Hal(line),
            };
            match wake {
                Wake::Command(None) => break,
                Wake::Command(Some(command)) => self.act(command).await,
                Wake::Socket(read) => self.heard(read, &socket_bytes),
                Wake::Sampler(read) => self.sampled(read, &sample_bytes).await,
                Wake::Drained => self.drained().await,
                Wake::Hal(line) => self.hal_spoke(line).await,
            }
        }
        self.end_sampler().await;
        self.end_hal().await;
    }

    async fn act(&mut self, command: IoCommand) {
        match command {
            IoCommand::Connect => self.connect().await,
            IoCommand::Disconnect => self.socket = None,
            IoCommand::Send(line) => self.send(&line).await,
            IoCommand::StartSampler => self.start_sampler().await,
            IoCommand::StopSampler => {
                self.end_sampler().await;
                self.end_hal().await;
            }
            IoCommand::Hal(lines) => self.set_hal(&lines).await,
            IoCommand::Store { number, text } => self.store(number, &text).await,
        }
    }

    async fn connect(&mut self) {
        let target = (self.address.host.as_str(), self.address.port);
        let event = match timeout(CONNECT_LIMIT, TcpStream::connect(target)).await {
            Ok(Ok(socket)) => {
                // Requests are single short lines that wait for an answer.
                let _ = socket.set_nodelay(true);
                self.socket = Some(socket);
                IoEvent::Connected
            }
            Ok(Err(error)) => IoEvent::NotConnected {
                reason: error.to_string(),
            },
            Err(_) => IoEvent::NotConnected {
                reason: "no answer in time".to_owned(),
            },
        };
        self.tell(event);
    }

    async fn send(&mut self, line: &str) {
        if let Some(socket) = &mut self.socket
            && let Err(error) = socket.write_all(line.as_bytes()).await
        {
            self.socket = None;
            self.tell(IoEvent::Closed {
                reason: error.to_string(),
            });
        }
    }

    fn heard(&mut self, read: io::Result<usize>, bytes: &[u8]) {
        match read {
            Ok(0) => {
                self.socket = None;
                self.tell(IoEvent::Closed {
                    reason: "end of stream".to_owned(),
                });
            }
            Ok(length) => self.tell(IoEvent::Received(bytes[..length].to_vec())),
            Err(error) => {
                self.socket = None;
                self.tell(IoEvent::Closed {
                    reason: error.to_string(),
                });
            }
        }
    }

    async fn start_sampler(&mut self) {
        self.end_sampler().await;
        if let Err(error) = self.try_start_sampler().await {
            self.end_sampler().await;
            self.tell(IoEvent::SamplerEnded {
                reason: error.to_string(),
            });
        }
    }

    async fn try_start_sampler(&mut self) -> io::Result<()> {
        self.give_hal("setp sampler.0.enable 0\n").await?;
        // Without stdbuf a pipe would hold records back until 4 KiB are full.
        let mut child = self
            .command("stdbuf")
            .args(["-oL", "halsampler", "-t"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()?;
        let stdout = child.stdout.take().ok_or(io::ErrorKind::BrokenPipe)?;
        let draining = Some(Instant::now() + DRAIN_TIME);
        self.sampler = Some(Sampler {
            child,
            stdout,
            draining,
        });
        Ok(())
    }

    async fn drained(&mut self) {
        if let Some(sampler) = &mut self.sampler {
            sampler.draining = None;
        }
        self.set_hal("setp sampler.0.enable 1\n").await;
    }

    async fn sampled(&mut self, read: io::Result<usize>, bytes: &[u8]) {
        let draining = self
            .sampler
            .as_ref()
            .is_some_and(|sampler| sampler.draining.is_some());
        let reason = match read {
            Ok(0) => "halsampler ended".to_owned(),
            Ok(_) if draining => return,
            Ok(length) => return self.tell(IoEvent::Sampled(bytes[..length].to_vec())),
            Err(error) => error.to_string(),
        };
        self.end_sampler().await;
        self.tell(IoEvent::SamplerEnded { reason });
    }

    async fn set_hal(&mut self, lines: &str) {
        if let Err(error) = self.give_hal(lines).await {
            self.end_hal().await;
            self.tell(IoEvent::HalComplained {
                message: format!("halcmd: {error}"),
            });
        }
    }

    async fn give_hal(&mut self, lines: &str) -> io::Result<()> {
        if self.hal.is_none() {
            let mut child = self
                .command("halcmd")
                .args(["-k", "-f"])
                .stdin(Stdio::piped())
                .stdout(Stdio::null())
                .stderr(Stdio::piped())
                .spawn()?;
            let stdin = child.stdin.take().ok_or(io::ErrorKind::BrokenPipe)?;
            let stderr = child.stderr.take().ok_or(io::ErrorKind::BrokenPipe)?;
            self.hal = Some(Hal {
                child,
                stdin,
                stderr: BufReader::new(stderr).lines(),
            });
        }
        match &mut self.hal {
            Some(hal) => hal.stdin.write_all(lines.as_bytes()).await,
            None => Ok(()),
        }
    }

    async fn hal_spoke(&mut self, line: io::Result<Option<String>>) {
        match line {
            Ok(Some(line)) if line.starts_with("Note:") => {}
            Ok(Some(message)) => self.tell(IoEvent::HalComplained { message }),
            Ok(None) | Err(_) => self.end_hal().await,
        }
    }

    async fn store(&self, number: u32, text: &str) {
        let path = self
            .address
            .account
            .home()
            .join(format!("abbe_{number}.ngc"));
        if let Some(old) = number.checked_sub(2) {
            // Usually there is none; a file left behind harms nobody.
            let old = self.address.account.home().join(format!("abbe_{old}.ngc"));
            let _ = tokio::fs::remove_file(old).await;
        }
        let shown = path.display().to_string();
        self.tell(match tokio::fs::write(&path, text).await {
            Ok(()) => IoEvent::Stored {
                number,
                path: shown,
            },
            Err(error) => IoEvent::NotStored {
                number,
                reason: format!("{shown}: {error}"),
            },
        });
    }

    fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        self.address.account.apply(command.as_std_mut());
        command.kill_on_drop(true);
        command
    }

    async fn end_sampler(&mut self) {
        if let Some(sampler) = self.sampler.take() {
            end(sampler.child).await;
        }
    }

    async fn end_hal(&mut self) {
        if let Some(hal) = self.hal.take() {
            // halcmd ends at the end of its input, and leaves HAL as a component should.
            drop(hal.stdin);
            let mut child = hal.child;
            if timeout(KILL_LIMIT, child.wait()).await.is_err() {
                end(child).await;
            }
        }
    }
}

/// Ends a process of ours as it likes to be ended, then for certain.
async fn end(mut child: Child) {
    if let Some(pid) = child.id().and_then(|pid| i32::try_from(pid).ok()) {
        // It may have ended in this moment.
        let _ = kill(Pid::from_raw(pid), Signal::SIGTERM);
    }
    if timeout(KILL_LIMIT, child.wait()).await.is_err() {
        let _ = child.kill().await;
    }
}

async fn read_socket(socket: Option<&mut TcpStream>, bytes: &mut [u8]) -> io::Result<usize> {
    match socket {
        Some(socket) => socket.read(bytes).await,
        None => std::future::pending().await,
    }
}

async fn read_sampler(sampler: Option<&mut Sampler>, bytes: &mut [u8]) -> io::Result<usize> {
    match sampler {
        Some(sampler) => sampler.stdout.read(bytes).await,
        None => std::future::pending().await,
    }
}

async fn read_hal(hal: Option<&mut Hal>) -> io::Result<Option<String>> {
    match hal {
        Some(hal) => hal.stderr.next_line().await,
        None => std::future::pending().await,
    }
}

async fn wait(until: Option<Instant>) {
    match until {
        Some(until) => sleep_until(until).await,
        None => std::future::pending().await,
    }
}
