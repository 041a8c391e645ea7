//! What stands in the files that the parameters name.

use anyhow::{Result, anyhow, ensure};
use node_runtime::Setup;
use opcua_bridge::config::SecurityConfig;
use opcua_bridge::io::Credentials;
use opcua_bridge::ready;

/// Reads the password, and finds the folder of the certificates.
///
/// # Errors
/// When the file of the password cannot be read, or is empty.
pub(crate) fn credentials(setup: &Setup, security: &SecurityConfig) -> Result<Credentials> {
    let mut credentials = Credentials::default();
    if !security.pki_folder.is_empty() {
        credentials.pki_folder = Some(setup.file_path("security.pki_folder")?);
    }
    if !security.password_file.is_empty() {
        let (path, text) = setup.file_text("security.password_file")?;
        let password = text.trim_end_matches(['\r', '\n']);
        ensure!(
            !password.is_empty(),
            "{}: must hold the password of security.user in its one line",
            path.display()
        );
        credentials.password = Some(password.to_owned());
    }
    Ok(credentials)
}

/// Name and text of the mapping: a file, or one that is ready.
///
/// # Errors
/// When the file cannot be read, or there is no ready mapping of that name.
pub(crate) fn mapping(setup: &Setup, map_file: &str) -> Result<(String, String)> {
    match ready::of(map_file) {
        Some(ready) => {
            let text = ready.map_err(|reason| anyhow!(reason))?;
            Ok((map_file.to_owned(), text.to_owned()))
        }
        None => {
            let (path, text) = setup.file_text("map_file")?;
            Ok((path.display().to_string(), text))
        }
    }
}
