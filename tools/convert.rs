//! Makes Tallow's scene files for the outside scenes:
//!
//! `TALLOW_DATA=../shared cargo run --release --example convert -- -o out/scenes`
use clap::Parser;
use std::path::PathBuf;

mod scenes;

#[derive(Parser)]
#[command(about = "Makes scene files for the outside scenes")]
struct Args {
    /// Scenes to convert; all when none is named. fox and rigid take a frame: fox-15, rigid-59
    names: Vec<String>,
    /// Folder to write NAME.toml into
    #[arg(short, long)]
    output: PathBuf,
    /// Folder of the outside data
    #[arg(long, env = "TALLOW_DATA")]
    data: PathBuf,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let all = || scenes::names().collect();
    for name in if args.names.is_empty() { all() } else { args.names.clone() } {
        println!("{}", scenes::convert(&name, &args.data, &args.output)?.display());
    }
    Ok(())
}
