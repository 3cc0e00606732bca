//! Words and commands of the system's shell.

use std::process::Command;

/// `word` in quotes of a POSIX shell.
pub fn posix_quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', "'\\''"))
}

/// `word` in quotes of the system's shell.
pub fn quoted(word: &str) -> String {
    if cfg!(windows) { format!("\"{word}\"") } else { posix_quoted(word) }
}

/// What runs `words` in the system's shell.
pub fn command(words: &str) -> Command {
    #[cfg(windows)]
    {
        use std::os::windows::process::CommandExt;
        let mut shell = Command::new("cmd");
        // Quoted as it is, it would be quoted again.
        shell.raw_arg("/C").raw_arg(words);
        shell
    }
    #[cfg(not(windows))]
    {
        let mut shell = Command::new("sh");
        shell.args(["-c", words]);
        shell
    }
}
