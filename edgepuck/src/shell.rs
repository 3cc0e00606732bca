use std::process::Command;

/// `word`, quoted for the system's shell.
pub fn quoted(word: &str) -> String {
    if cfg!(windows) { format!("\"{word}\"") } else { format!("'{}'", word.replace('\'', "'\\''")) }
}

/// A command that runs `words` in the system's shell.
pub fn command(words: &str) -> Command {
    #[cfg(windows)]
    {
        use std::os::windows::process::CommandExt;
        let mut shell = Command::new("cmd");
        // `arg` would quote the words again.
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
