//! A PostgreSQL server of a test's own, on loopback in a temporary folder, and never as root.

use std::fs::Permissions;
use std::net::TcpListener;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tempfile::TempDir;

use crate::authority::Signed;

/// How long a server may take to start.
const PATIENCE: Duration = Duration::from_secs(120);
/// The user `nobody`, whom the server runs as where the tests run as root.
const NOBODY: u32 = 65_534;

/// A running server, which ends with this value.
pub struct Server {
    home: TempDir,
    programs: PathBuf,
    port: u16,
    process: Option<Child>,
}

impl Server {
    /// Starts a server. On a computer without PostgreSQL, the test's name and the reason are printed.
    pub fn start(test: &str) -> Option<Self> {
        let Some(programs) = programs() else {
            let reason = "no /usr/lib/postgresql/*/bin/initdb: apt-get install postgresql (tests/run installs it)";
            assert!(std::env::var("CI").as_deref() != Ok("true"), "{reason}");
            eprintln!("NOT TESTED: {test}: {reason}");
            return None;
        };
        let port = free_port();
        let home = tempfile::tempdir().unwrap();
        if nix::unistd::Uid::effective().is_root() {
            chown(home.path(), Some(NOBODY), Some(NOBODY)).unwrap();
        }
        let mut server = Self {
            home,
            programs,
            port,
            process: None,
        };
        let data = server.data();
        let made = server
            .command("initdb")
            .args([
                "--no-sync",
                "--auth=trust",
                "--username=owner",
                "-E",
                "UTF8",
            ])
            .arg("-D")
            .arg(&data)
            .output()
            .unwrap();
        assert!(made.status.success(), "{made:?}");
        server.run();
        Some(server)
    }

    /// The port on loopback.
    pub const fn port(&self) -> u16 {
        self.port
    }

    /// The folder of its local socket.
    pub fn socket_folder(&self) -> &Path {
        self.home.path()
    }

    /// Starts it anew with a certificate and the authority of its clients, or without TLS, and with these rights.
    pub fn secure(&mut self, tls: Option<(&Signed, &Path)>, rights: &str) {
        let mut settings = "ssl = off\n".to_owned();
        if let Some((signed, authority)) = tls {
            let files = [&signed.certificate, &signed.key, authority];
            for (file, name) in files.iter().zip(["server.crt", "server.key", "ca.crt"]) {
                self.place(name, &std::fs::read(file).unwrap());
            }
            settings = "ssl = on\nssl_ca_file = 'ca.crt'\n".to_owned();
        }
        self.place("pg_hba.conf", rights.as_bytes());
        self.place("postgresql.auto.conf", settings.as_bytes());
        self.kill();
        self.run();
    }

    /// A file of the server that nobody else can read.
    fn place(&self, name: &str, content: &[u8]) {
        let file = self.data().join(name);
        std::fs::write(&file, content).unwrap();
        std::fs::set_permissions(&file, Permissions::from_mode(0o600)).unwrap();
        if nix::unistd::Uid::effective().is_root() {
            chown(&file, Some(NOBODY), Some(NOBODY)).unwrap();
        }
    }

    fn data(&self) -> PathBuf {
        self.home.path().join("data")
    }

    fn command(&self, name: &str) -> Command {
        let mut command = Command::new(self.programs.join(name));
        command.current_dir(self.home.path()).env("LC_ALL", "C");
        if nix::unistd::Uid::effective().is_root() {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }

    /// Starts the process, and waits until it answers.
    pub fn run(&mut self) {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            let data = self.data();
            let port = self.port.to_string();
            let started = self
                .command("postgres")
                .arg("-D")
                .arg(&data)
                .args(["-p", &port, "-c", "listen_addresses=127.0.0.1"])
                .arg("-k")
                .arg(self.home.path())
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            self.process = Some(started);
            // Where the one before still ends, it gives up at once.
            while began.elapsed() < PATIENCE && self.process.as_mut().is_some_and(is_running) {
                if self.is_ready() {
                    return;
                }
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        panic!("the server did not start within {PATIENCE:?}");
    }

    fn is_ready(&self) -> bool {
        let port = self.port.to_string();
        let asked = self
            .command("pg_isready")
            .args(["-h", "127.0.0.1", "-q", "-p", &port])
            .status();
        asked.unwrap().success()
    }

    /// Kills the server as a loss of power would.
    pub fn kill(&mut self) {
        let mut process = self.process.take().unwrap();
        process.kill().unwrap();
        process.wait().unwrap();
    }

    /// A new database, and its URL as a store.
    pub fn database(&self, name: &str) -> PathBuf {
        self.execute("postgres", &format!("CREATE DATABASE {name}"));
        self.url("owner", name)
    }

    /// The URL of a database for a user.
    pub fn url(&self, user: &str, database: &str) -> PathBuf {
        let port = self.port;
        PathBuf::from(format!("postgres://{user}@127.0.0.1:{port}/{database}"))
    }

    /// Runs SQL as the owner, and gives its output back.
    pub fn execute(&self, database: &str, sql: &str) -> String {
        let port = self.port.to_string();
        let done = self
            .command("psql")
            .arg("-h")
            .arg(self.home.path())
            .args(["-U", "owner", "-X", "-q", "-A", "-t"])
            .args(["-v", "ON_ERROR_STOP=1", "-p", &port, "-d", database])
            .args(["-c", sql])
            .output()
            .unwrap();
        assert!(done.status.success(), "{sql}: {done:?}");
        String::from_utf8(done.stdout).unwrap()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        if let Some(mut process) = self.process.take() {
            let _ = process.kill();
            let _ = process.wait();
        }
    }
}

/// A port that nobody has; it is given back before the server takes it.
fn free_port() -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    listener.local_addr().unwrap().port()
}

fn is_running(process: &mut Child) -> bool {
    process.try_wait().unwrap().is_none()
}

/// Folder of the programs of the newest version that is installed.
fn programs() -> Option<PathBuf> {
    let versions = std::fs::read_dir("/usr/lib/postgresql").ok()?;
    let all = versions.filter_map(|version| Some(version.ok()?.path().join("bin")));
    all.filter(|bin| bin.join("initdb").is_file())
        .max_by_key(|bin| number(bin))
}

fn number(bin: &Path) -> u32 {
    let version = bin.parent().and_then(Path::file_name);
    let version = version.and_then(|name| name.to_str()?.parse().ok());
    version.unwrap_or(0)
}
