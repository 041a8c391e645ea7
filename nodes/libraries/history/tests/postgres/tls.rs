//! Connections over TLS, against a real server and against those who pretend to be one.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

use history::{Added, HistoryError, Store};

use crate::authority::{Authority, Signed};
use crate::example::entry;
use crate::server::Server;
use crate::writing::PATIENT;

/// The password of each user here.
const PASSWORD: &str = "geheim7";
/// Who must have a password and TLS, or a certificate of his own.
const RIGHTS: &str = "local all all trust\n\
    hostssl all carrier 127.0.0.1/32 scram-sha-256 clientcert=verify-ca\n\
    hostssl all certified 127.0.0.1/32 cert\n\
    host all keeper 127.0.0.1/32 scram-sha-256\n";

/// A server with TLS, and its users.
fn secured(test: &str, authority: &Authority, signed: &Signed) -> Option<Server> {
    let mut server = Server::start(test)?;
    let users = ["keeper", "carrier", "certified"]
        .map(|user| format!("CREATE ROLE {user} LOGIN SUPERUSER PASSWORD '{PASSWORD}'"));
    let _ = server.database("fleet");
    server.execute("fleet", &users.join("; "));
    server.secure(Some((signed, &authority.certificate())), RIGHTS);
    Some(server)
}

/// The URL of a user, who reaches the server under the name `host`.
fn url(server: &Server, user: &str, host: &str, more: &str) -> PathBuf {
    let port = server.port();
    PathBuf::from(format!(
        "postgres://{user}:{PASSWORD}@{host}:{port}/fleet?hostaddr=127.0.0.1&{more}"
    ))
}

fn open(path: &Path) -> Result<Store, HistoryError> {
    let opened = Store::open(path, PATIENT);
    if let Err(error) = &opened {
        let (shown, inside) = (error.to_string(), format!("{error:?}"));
        assert!(!shown.contains(PASSWORD) && !inside.contains(PASSWORD));
    }
    opened
}

/// Whether the connections of an open store are over TLS, by the server's own view.
fn is_encrypted(server: &Server) -> bool {
    let sql = "SELECT bool_and(s.ssl) FROM pg_stat_ssl s JOIN pg_stat_activity a USING (pid) WHERE a.application_name = 'abbe'";
    match server.execute("fleet", sql).trim() {
        "t" => true,
        "f" => false,
        other => panic!("{other}"),
    }
}

#[test]
fn each_mode_is_met_by_the_right_server() {
    let authority = Authority::new("shop");
    let signed = authority.sign("db.shop", 2);
    let Some(server) = secured("each_mode_is_met_by_the_right_server", &authority, &signed) else {
        return;
    };
    let root = format!("sslrootcert={}", authority.certificate().display());
    for (host, more, has_tls) in [
        ("db.shop", format!("sslmode=verify-full&{root}"), true),
        ("db.shop", root.clone(), true),
        ("other.shop", format!("sslmode=verify-ca&{root}"), true),
        ("other.shop", format!("sslmode=require&{root}"), true),
        ("other.shop", "sslmode=require".to_owned(), true),
        ("other.shop", "sslmode=prefer".to_owned(), true),
        ("other.shop", String::new(), true),
        ("db.shop", "channel_binding=require".to_owned(), true),
        ("db.shop", "sslmode=disable".to_owned(), false),
    ] {
        let store = open(&url(&server, "keeper", host, &more)).unwrap();
        assert_eq!(is_encrypted(&server), has_tls, "{host} {more}");
        drop(store);
    }
}

#[test]
fn a_server_that_is_not_the_right_one_is_refused() {
    let (authority, stranger) = (Authority::new("shop"), Authority::new("stranger"));
    let signed = authority.sign("db.shop", 2);
    let name = "a_server_that_is_not_the_right_one_is_refused";
    let Some(mut server) = secured(name, &authority, &signed) else {
        return;
    };
    let root = |of: &Authority| format!("sslrootcert={}", of.certificate().display());
    let revoked = authority.revoked(Some(&signed));
    let all = format!("{}&sslcrl={}", root(&authority), revoked.display());
    for (host, more, words) in [
        ("db.shop", root(&stranger), "certificate verify failed: "),
        (
            "db.shop",
            format!("sslmode=verify-ca&{}", root(&stranger)),
            "certificate verify failed: ",
        ),
        (
            "db.shop",
            format!("sslmode=require&{}", root(&stranger)),
            "certificate verify failed: ",
        ),
        (
            "db.shop",
            format!("sslmode=prefer&{}", root(&stranger)),
            "certificate verify failed: ",
        ),
        ("other.shop", root(&authority), "hostname mismatch"),
        (
            "db.shop",
            "sslmode=verify-full&sslrootcert=system".to_owned(),
            "certificate verify failed: ",
        ),
        ("db.shop", all, "certificate revoked"),
    ] {
        let error = open(&url(&server, "keeper", host, &more)).unwrap_err();
        assert!(
            matches!(error, HistoryError::Untrusted { .. }),
            "{more}: {error:?}"
        );
        assert!(error.to_string().contains(words), "{error}");
    }
    let by_address = url(&server, "keeper", "127.0.0.1", &root(&authority));
    let error = open(&by_address).unwrap_err();
    assert!(error.to_string().contains("IP address mismatch"), "{error}");
    let expired = authority.sign("db.shop", -1);
    server.secure(Some((&expired, &authority.certificate())), RIGHTS);
    let error = open(&url(&server, "keeper", "db.shop", &root(&authority))).unwrap_err();
    assert!(matches!(error, HistoryError::Untrusted { .. }), "{error:?}");
    assert!(
        error.to_string().contains("certificate has expired"),
        "{error}"
    );
}

#[test]
fn a_server_without_tls_is_refused_where_there_must_be_tls() {
    let (authority, name) = (
        Authority::new("shop"),
        "a_server_without_tls_is_refused_where_there_must_be_tls",
    );
    let signed = authority.sign("db.shop", 2);
    let Some(mut server) = secured(name, &authority, &signed) else {
        return;
    };
    server.secure(None, RIGHTS);
    let root = format!("sslrootcert={}", authority.certificate().display());
    for more in [
        "sslmode=require",
        &root,
        &format!("sslmode=verify-ca&{root}"),
    ] {
        let error = open(&url(&server, "keeper", "db.shop", more)).unwrap_err();
        assert!(matches!(error, HistoryError::NoTls { .. }), "{error:?}");
        assert!(error.to_string().contains("ssl = on"), "{error}");
    }
    let store = open(&url(&server, "keeper", "db.shop", "sslmode=prefer")).unwrap();
    assert!(!is_encrypted(&server));
    drop(store);
    // Local sockets have no TLS, and need none.
    let socket = server.socket_folder();
    let port = server.port();
    let local = format!(
        "postgres://owner@/fleet?host={}&port={port}&sslmode=require",
        socket.display()
    );
    open(Path::new(&local)).unwrap();
}

/// Answers as `answer`, and gives back what a client said first and after that.
fn pretend(answer: &'static [u8], more: &str) -> (HistoryError, Vec<u8>) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = listener.local_addr().unwrap().port();
    let heard = std::thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        let mut request = [0; 8];
        stream.read_exact(&mut request).unwrap();
        stream.write_all(answer).unwrap();
        let mut rest = Vec::new();
        let _ = stream.read_to_end(&mut rest);
        [request.to_vec(), rest].concat()
    });
    let path =
        format!("postgres://keeper:{PASSWORD}@localhost:{port}/fleet?hostaddr=127.0.0.1&{more}");
    let error = open(Path::new(&path)).unwrap_err();
    (error, heard.join().unwrap())
}

#[test]
fn who_stands_between_and_denies_tls_hears_no_user_and_no_password() {
    let authority = Authority::new("shop");
    let root = format!("sslrootcert={}", authority.certificate().display());
    /// The request for TLS, and nothing else (PostgreSQL, "Message Formats": SSLRequest).
    const REQUEST: [u8; 8] = [0, 0, 0, 8, 4, 210, 22, 47];
    // `N` and a demand for a password in plain text; an error message of a server before TLS.
    let demand = b"NR\0\0\0\x08\0\0\0\x03";
    let old = b"E\0\0\0\x0dSFATAL\0\0";
    for answer in [demand.as_slice(), old] {
        for more in ["sslmode=require", root.as_str()] {
            let (error, heard) = pretend(answer, more);
            assert!(matches!(error, HistoryError::NoTls { .. }), "{error:?}");
            assert_eq!(heard, REQUEST);
        }
    }
    // It says yes, and goes on without TLS.
    for more in ["sslmode=require", "sslmode=prefer", root.as_str()] {
        let (error, heard) = pretend(b"SR\0\0\0\x08\0\0\0\x03", more);
        assert!(matches!(error, HistoryError::Untrusted { .. }), "{error:?}");
        let text = String::from_utf8_lossy(&heard);
        assert!(
            !text.contains("keeper") && !text.contains(PASSWORD),
            "{text}"
        );
    }
}

#[test]
fn a_client_shows_its_own_certificate() {
    let (authority, stranger) = (Authority::new("shop"), Authority::new("stranger"));
    let signed = authority.sign("db.shop", 2);
    let Some(server) = secured("a_client_shows_its_own_certificate", &authority, &signed) else {
        return;
    };
    let root = format!("sslrootcert={}", authority.certificate().display());
    let with = |key: &Signed, file: &Path| {
        let certificate = key.certificate.display();
        format!("{root}&sslcert={certificate}&sslkey={}", file.display())
    };
    let own = authority.sign("certified", 2);
    let ours = with(&own, &own.key);
    open(&url(&server, "certified", "db.shop", &ours)).unwrap();
    open(&url(&server, "carrier", "db.shop", &ours)).unwrap();
    let encrypted = authority.encrypted(&own, "w&5");
    let locked = with(&own, &encrypted);
    let unlocked = format!("{locked}&sslpassword=w%265");
    open(&url(&server, "certified", "db.shop", &unlocked)).unwrap();
    let theirs = stranger.sign("certified", 2);
    let of_stranger = with(&theirs, &theirs.key);
    let mixed = with(&own, &theirs.key);
    for (user, more, words) in [
        ("certified", root.clone(), "certificate"),
        ("carrier", root.clone(), "certificate"),
        ("certified", of_stranger, "unknown ca"),
        ("certified", locked, "sslpassword"),
        ("certified", mixed, "key values mismatch"),
        ("certified", format!("{ours}.gone"), "No such file"),
        (
            "certified",
            format!("{root}&sslkey={}", own.key.display()),
            "sslcert",
        ),
    ] {
        let error = open(&url(&server, user, "db.shop", &more)).unwrap_err();
        let is_late = matches!(error, HistoryError::Unreachable { .. });
        assert!(
            !is_late && error.to_string().contains(words),
            "{more}: {error}"
        );
    }
    let readable = std::fs::Permissions::from_mode(0o644);
    std::fs::set_permissions(&own.key, readable).unwrap();
    let error = open(&url(&server, "certified", "db.shop", &ours)).unwrap_err();
    assert!(error.to_string().contains("0644"), "{error}");
}

#[test]
fn a_server_that_is_killed_comes_back_over_tls() {
    let authority = Authority::new("shop");
    let signed = authority.sign("db.shop", 2);
    let name = "a_server_that_is_killed_comes_back_over_tls";
    let Some(mut server) = secured(name, &authority, &signed) else {
        return;
    };
    let root = format!("sslrootcert={}", authority.certificate().display());
    let mut store = open(&url(&server, "keeper", "db.shop", &root)).unwrap();
    assert_eq!(store.add(&entry("m", 1, 100, 1.0)).unwrap(), Added::New);
    server.kill();
    server.run();
    assert_eq!(store.add(&entry("m", 2, 200, 1.0)).unwrap(), Added::New);
    assert!(is_encrypted(&server));
    assert_eq!(
        server
            .execute("fleet", "SELECT count(*) FROM abbe.entry")
            .trim(),
        "2"
    );
}

/// Opens a store for another test, in a process with other variables.
#[test]
fn opens_for_another_test() {
    let Ok(path) = std::env::var("ABBE_TEST_STORE") else {
        return;
    };
    match open(Path::new(&path)) {
        Ok(_) => println!("OPENED"),
        Err(error) => println!("{error}"),
    }
}

fn opened_with(path: &Path, variable: &str, value: &Path) -> String {
    let done = Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "tls::opens_for_another_test", "--nocapture"])
        .env("ABBE_TEST_STORE", path)
        .env(variable, value)
        .output()
        .unwrap();
    String::from_utf8(done.stdout).unwrap()
}

#[test]
fn authorities_of_the_computer_count_only_where_they_are_named() {
    let (authority, stranger) = (Authority::new("shop"), Authority::new("stranger"));
    let signed = authority.sign("db.shop", 2);
    let name = "authorities_of_the_computer_count_only_where_they_are_named";
    let Some(server) = secured(name, &authority, &signed) else {
        return;
    };
    let trusted = authority.certificate();
    let system = url(&server, "keeper", "db.shop", "sslrootcert=system");
    assert!(opened_with(&system, "SSL_CERT_FILE", &trusted).contains("OPENED"));
    let named = format!("sslrootcert={}", stranger.certificate().display());
    let named = url(&server, "keeper", "db.shop", &named);
    let text = opened_with(&named, "SSL_CERT_FILE", &trusted);
    assert!(text.contains("certificate verify failed"), "{text}");
    let weak = url(
        &server,
        "keeper",
        "db.shop",
        "sslmode=require&sslrootcert=system",
    );
    let error = open(&weak).unwrap_err();
    assert!(error.to_string().contains("must be verify-full"), "{error}");
}

#[test]
fn files_in_the_home_folder_stand_for_those_that_are_not_named() {
    let (authority, stranger) = (Authority::new("shop"), Authority::new("stranger"));
    let signed = authority.sign("db.shop", 2);
    let name = "files_in_the_home_folder_stand_for_those_that_are_not_named";
    let Some(server) = secured(name, &authority, &signed) else {
        return;
    };
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join(".postgresql");
    std::fs::create_dir(&folder).unwrap();
    let full = url(&server, "certified", "db.shop", "sslmode=verify-full");
    let text = opened_with(&full, "HOME", home.path());
    assert!(
        text.contains("root.crt") && text.contains("sslrootcert=system"),
        "{text}"
    );
    let own = authority.sign("certified", 2);
    let root = folder.join("root.crt");
    std::fs::copy(authority.certificate(), &root).unwrap();
    std::fs::copy(&own.certificate, folder.join("postgresql.crt")).unwrap();
    std::fs::copy(&own.key, folder.join("postgresql.key")).unwrap();
    let text = opened_with(&full, "HOME", home.path());
    assert!(text.contains("OPENED"), "{text}");
    // With an authority there, `require` means one of its certificates, as in libpq.
    std::fs::copy(stranger.certificate(), &root).unwrap();
    let weak = url(&server, "keeper", "db.shop", "sslmode=require");
    let text = opened_with(&weak, "HOME", home.path());
    assert!(text.contains("certificate verify failed"), "{text}");
}
