//! Command lines that render a pixel of a file again.
use super::report;
use crate::cli::choices::Choices;
use crate::cli::quoted;
use crate::cli::render::FRAME;
use crate::error::Checked;
use crate::image::Film;
use crate::render::provenance::{Provenance, SampleRange};
use crate::render::settings::Settings;
use serde_json::Value;

/// One command line for every render that went into a file, each of which takes the samples of one pixel again.
///
/// # Errors
/// What the file does not tell.
pub fn commands(film: &Film, [x, y]: [u32; 2], stem: &str) -> Checked<Vec<String>> {
    let scene = film.metadata.get("scene").ok_or("its metadata do not name the scene")?;
    if let Some(frame) = film.metadata.get(FRAME) {
        return Err(format!(
            "it is a frame of a sequence, which tallow sequence --only {frame} renders again as a whole"
        ));
    }
    let view = Choices::of(&film.metadata).words();
    let Provenance { settings, samples: ranges, .. } = Provenance::of(film)?;
    let taken =
        film.channel(report::SAMPLES).map(|counts| counts.at(y as usize * film.width as usize + x as usize) as u32);
    let all: u32 = ranges.iter().map(|range| range.count).sum();
    if ranges.len() > 1 && taken.is_some_and(|taken| taken != all) {
        return Err("it is of several renders, and nothing tells which of their samples this pixel has".to_owned());
    }
    let command = |(i, range): (usize, &SampleRange)| {
        let alone = ranges.len() == 1;
        let part = if alone { String::new() } else { format!("-{i}") };
        // Where samples were placed, a range tells how many the pixel has that has most.
        let spp = taken.filter(|_| alone).unwrap_or(range.count);
        let SampleRange { seed, first, .. } = range;
        format!(
            "tallow render {}{view} {}--seed {seed} --first-sample {first} --spp {spp} --pixel {x},{y} -o {stem}-{x}-{y}{part}.exr",
            quoted(scene),
            options(&settings),
        )
    };
    Ok(ranges.iter().enumerate().map(command).collect())
}

/// The settings of film, paths and random numbers. All are given, since the scene file may have been changed.
fn options(settings: &Value) -> String {
    const SAMPLES: [&str; 4] = ["spp", "seed", "first_sample", "allocate"];
    let settings = settings.as_object().into_iter().flatten();
    let option = |(key, value): (&String, &Value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        format!("--{} {} ", key.replace('_', "-"), quoted(&value))
    };
    settings.filter(|(key, _)| !SAMPLES.contains(&key.as_str()) && is_option(key)).map(option).collect()
}

fn is_option(key: &str) -> bool {
    Settings::default().entries().iter().any(|entry| entry.name == key.replace('_', "-"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_takes_the_samples_of_every_range() {
        let mut film = Film::new(3, 2);
        film.add("samples", crate::image::Samples::U32(vec![9; 6]));
        let settings =
            r#"{"width":3,"height":2,"filter":"tent","spp":9,"seed":1,"allocate":{"policy":"both"},"unknown":1}"#;
        film.metadata.insert("settings".to_owned(), settings.to_owned());
        film.metadata.insert("sceneFingerprint".to_owned(), "0".to_owned());
        assert!(commands(&film, [2, 1], "a").unwrap_err().contains("scene"));
        film.metadata.insert("scene".to_owned(), "my scene.toml".to_owned());
        let ranges = |film: &mut Film, text: &str| film.metadata.insert("sampleRanges".to_owned(), text.to_owned());
        ranges(&mut film, r#"[{"seed":5,"first":7,"count":20}]"#);
        let one = commands(&film, [2, 1], "a").unwrap();
        let expected = "tallow render 'my scene.toml' --width 3 --height 2 --filter tent --seed 5 --first-sample 7 --spp 9 \
                        --pixel 2,1 -o a-2-1.exr";
        let sorted = |line: &str| {
            let mut words: Vec<_> = line.split(" --").map(str::to_owned).collect();
            words.sort();
            words
        };
        assert_eq!(one.iter().map(|l| sorted(l)).collect::<Vec<_>>(), [sorted(expected)]);
        film.metadata.insert("camera".to_owned(), "from above".to_owned());
        assert!(commands(&film, [2, 1], "a").unwrap()[0].contains(" --camera 'from above' "));
        film.metadata.insert("frame".to_owned(), "7".to_owned());
        assert!(commands(&film, [2, 1], "a").unwrap_err().contains("--only 7"));
        film.metadata.remove("frame");
        ranges(&mut film, r#"[{"seed":5,"first":7,"count":4},{"seed":6,"first":0,"count":5}]"#);
        let two = commands(&film, [2, 1], "a").unwrap();
        ranges(&mut film, r#"[{"seed":5,"first":7,"count":4},{"seed":6,"first":0,"count":50}]"#);
        assert!(commands(&film, [2, 1], "a").unwrap_err().contains("nothing tells which"), "of placed samples");
        assert!(two.len() == 2 && two[1].contains("--seed 6 --first-sample 0 --spp 5 ") && two[1].ends_with("-1.exr"));
    }
}
