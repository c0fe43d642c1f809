//! Tests of `tallow sequence`: frames alone and in a row, finished ones, and those that fail.
use crate::command::{complains, stdout, tallow};
use std::fs;
use std::process::Output;
use tallow::image::{self, Film, Samples, WriteOptions};
use tempfile::TempDir;

const SMALL: &str = "--width 40 --height 25 --spp 2";

fn stage() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/moving/scene.toml");
    fs::copy(scene, folder.path().join("s.toml")).unwrap();
    folder
}

fn run(folder: &TempDir, words: &str) -> Output {
    let all = format!("sequence s.toml {SMALL} {words}");
    tallow(folder, &all.split_whitespace().collect::<Vec<_>>())
}

fn well(folder: &TempDir, words: &str) -> String {
    let output = run(folder, words);
    assert!(output.status.success() && output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    stdout(&output)
}

/// Bits of all channels.
fn bits(folder: &TempDir, file: &str) -> Vec<(String, Vec<u32>)> {
    let Film { channels, .. } = image::read(&folder.path().join(file)).unwrap();
    let bits = |samples: Samples| match samples {
        Samples::F32(values) => values.into_iter().map(f32::to_bits).collect(),
        Samples::U32(values) => values,
    };
    channels.into_iter().map(|c| (c.name, bits(c.samples))).collect()
}

#[test]
fn a_frame_alone_is_that_of_the_sequence_and_a_finished_one_is_kept() {
    let folder = stage();
    let told = well(&folder, "--reproject off --frames 0..48 --only 9..=12 --fps 6 -o a.####.exr --preview a.gif");
    assert!(told.contains("frame 12: ") && told.contains("3 more"), "{told}");
    well(&folder, "--reproject off --frames 0..48 --only 12 --fps 6 -o b.##.exr");
    assert!(bits(&folder, "a.0012.exr") == bits(&folder, "b.12.exr"), "frame 12 alone");
    assert!(bits(&folder, "a.0012.exr") != bits(&folder, "a.0011.exr"), "control");
    let gif = fs::read(folder.path().join("a.gif")).unwrap();
    assert!(gif.starts_with(b"GIF89a") && gif.len() > 2000);
    // What was finished is kept, what is damaged or of other settings is not.
    let made = |file: &str| fs::metadata(folder.path().join(file)).unwrap().modified().unwrap();
    let before = made("a.0010.exr");
    fs::write(folder.path().join("a.0011.exr"), "cut").unwrap();
    let told = well(&folder, "--reproject off --frames 0..48 --only 9..=12 --fps 6 -o a.####.exr");
    assert!(told.contains("frame 10: is finished") && !told.contains("frame 11: is finished"), "{told}");
    assert_eq!(made("a.0010.exr"), before);
    let told = well(&folder, "--reproject off --frames 0..48 --only 10 --fps 12 -o a.####.exr");
    assert!(!told.contains("is finished"), "at another time the scene is another: {told}");
    let told = well(&folder, "--reproject off --frames 0..48 --only 9 --fps 6 --seed-per-frame -o a.####.exr");
    assert!(!told.contains("is finished"), "{told}");
    // A film of another size is another, too.
    let words = "sequence s.toml --width 40 --height 26 --spp 2 --reproject off --frames 0..48 --only 11..=12 --fps 6 -o a.####.exr";
    let sized = || stdout(&tallow(&folder, &words.split_whitespace().collect::<Vec<_>>()));
    assert!(!sized().contains("is finished"));
    assert!(sized().contains("frame 12: is finished"), "control");
}

#[test]
fn a_frame_of_another_filter_is_another_and_pictures_are_written_as_they_are_asked_for() {
    let folder = stage();
    let words = "--reproject off --frames 0..2 -o f.#.exr -o f.#.png";
    let read = |file: &str| fs::read(folder.path().join(file)).unwrap();
    well(&folder, &format!("{words} --denoise atrous"));
    let (filtered, picture) = (bits(&folder, "f.1.exr"), read("f.1.png"));
    let told = well(&folder, &format!("{words} --denoise atrous --exposure 3 --heatmap h.#.png"));
    assert!(told.contains("frame 1: is finished") && filtered == bits(&folder, "f.1.exr"), "{told}");
    assert!(read("f.1.png") != picture && read("h.1.png").starts_with(b"\x89PNG"));
    let told = well(&folder, &format!("{words} --denoise bilateral"));
    assert!(!told.contains("is finished") && filtered != bits(&folder, "f.1.exr"), "{told}");
    let told = well(&folder, &format!("{words} --denoise bilateral"));
    assert!(told.contains("frame 1: is finished"), "control: {told}");
}

/// A sky may come from black. The last key lies on frame 29, which no number in binary says; the camera's matrix keeps it from moving.
#[test]
fn keys_on_frames_are_reached_and_a_black_sky_may_light_up() {
    let folder = stage();
    let write = |text: &str| fs::write(folder.path().join("s.toml"), text).unwrap();
    let sky = "[environment]\nradiance = 0\n[[mesh]]\nshape = 'cube'\n[[animation]]\nenvironment = true\n\
               interpolation = 'step'\nkeys = [{ time = 0, radiance = 0 }, { time = 1.16, radiance = 1 }]\n";
    write(sky);
    // It warns that there is no light in the scene as it is loaded.
    let told = stdout(&run(&folder, "--fps 25 --reproject off -o k.##.exr"));
    assert!(told.contains("frame 29: ") && !told.contains("frame 30: "), "{told}");
    let light = |frame: &str| image::read(&folder.path().join(frame)).unwrap().picture(None).unwrap().pixels.concat();
    assert!(light("k.28.exr").iter().all(|&v| v == 0.0) && light("k.29.exr").iter().any(|&v| v > 0.0));
    let matrix = "[camera]\nworld_from_camera = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 5, 0, 0, 0, 1]\n";
    let keys = "[[animation]]\ncamera = true\nkeys = [{ time = 0, position = [0, 0, 5] }, { time = 1, position = [1, 0, 5] }]\n";
    write(&format!("{matrix}[[mesh]]\nshape = 'cube'\n{keys}"));
    complains(&run(&folder, "-o m.##.exr"), 3, &["world_from_camera"]);
}

/// What lies before and after a frame with a lens begins anew, and is rendered.
#[test]
fn frames_through_a_lens_are_rendered_among_others() {
    let folder = stage();
    let scene = fs::read_to_string(folder.path().join("s.toml")).unwrap();
    let keys = "[[animation]]\ncamera = true\nkeys = [{ time = 0, lens_radius = 0 }, { time = 1, lens_radius = 0 }, \
                { time = 2, lens_radius = 0.2 }, { time = 3, lens_radius = 0 }]\n";
    let still = scene.split("[[animation]]").next().unwrap();
    fs::write(folder.path().join("s.toml"), format!("{still}{keys}")).unwrap();
    well(&folder, "--frames 0..5 --fps 1 --reproject forward -o l.#.exr --quiet");
    let carried = |frame: usize| {
        let film = image::read(&folder.path().join(format!("l.{frame}.exr"))).unwrap();
        matches!(film.channel("carried.samples"), Some(Samples::U32(counts)) if counts.iter().any(|&n| n > 0))
    };
    assert_eq!([0, 1, 2, 3, 4].map(carried), [false, true, false, false, true]);
}

/// How alike the noise of two frames is, from 0 to 1: over an endless floor, a camera that is moved sees the same.
fn alike(folder: &TempDir, [a, b]: [&str; 2]) -> f64 {
    let [a, b] = [a, b].map(|file| {
        let film = image::read(&folder.path().join(file)).unwrap();
        let Some(Samples::F32(red)) = film.channel("R") else { panic!("{file}: no red") };
        let mean = red.iter().map(|&v| f64::from(v)).sum::<f64>() / red.len() as f64;
        red.iter().map(|&v| f64::from(v) - mean).collect::<Vec<_>>()
    });
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt()
}

/// Behind a lens nothing is carried. Noise of one seed would be a pattern on the screen, through which the scene slides.
#[test]
fn noise_does_not_go_with_a_camera_that_moves() {
    let folder = stage();
    let scene = "[film]\nwidth = 40\nheight = 25\n[render]\nspp = 2\n[camera]\nposition = [0, 50, 0]\ntarget = [0, 0, 0]\n\
                 up = [0, 0, 1]\nfov = 10\nlens_radius = 0.1\n[[mesh]]\nshape = 'rectangle'\n\
                 transform = { rotate = [-90, 0, 0], scale = 1e4 }\nmaterial = 'floor'\n[[material]]\nname = 'floor'\n\
                 [[mesh]]\nname = 'far'\nshape = 'cube'\nmaterial = 'floor'\ntransform = { translate = [5e3, 1, 0] }\n\
                 [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = { rotate = [90, 0, 0], scale = 1e3, translate = [0, 1e3, 0] }\n\
                 [[material]]\nname = 'lamp'\nemission = 5\n[[animation]]\n";
    let write = |moves: &str| fs::write(folder.path().join("s.toml"), format!("{scene}{moves}")).unwrap();
    write(
        "camera = true\nkeys = [{ time = 0, position = [0, 50, 0], target = [0, 0, 0] }, \
           { time = 2, position = [2, 50, 0], target = [2, 0, 0] }]\n",
    );
    well(&folder, "--frames 0..3 --fps 1 -o m.#.exr --quiet");
    well(&folder, "--frames 0..3 --fps 1 --only 2 -o alone.#.exr --quiet");
    assert!(bits(&folder, "m.2.exr") == bits(&folder, "alone.2.exr"), "a frame alone is that of the sequence");
    let of_moving = alike(&folder, ["m.0.exr", "m.1.exr"]);
    write("instance = 'far'\nkeys = [{ time = 0, translate = [5e3, 1, 0] }, { time = 2, translate = [5e3, 2, 0] }]\n");
    well(&folder, "--frames 0..3 --fps 1 -o s.#.exr --quiet");
    let of_still = alike(&folder, ["s.0.exr", "s.1.exr"]);
    assert!(of_moving < 0.3 && of_still > 0.9, "{of_moving}, {of_still}");
}

#[test]
fn a_frame_in_another_light_is_another() {
    let folder = stage();
    let file = folder.path().join("s.toml");
    let words = "--frames 0..48 --only 0..=1 --fps 1 -o l.#.exr";
    well(&folder, words);
    let scene = fs::read_to_string(&file).unwrap();
    let other = scene.replace("time = 1, intensity = [1, 2, 6]", "time = 1, intensity = [1, 2, 7]");
    assert_ne!(scene, other);
    fs::write(&file, other).unwrap();
    let told = well(&folder, words);
    assert!(told.contains("frame 0: is finished") && !told.contains("frame 1: is finished"), "{told}");
}

/// Frames hold what the next one begins with, and know the ones before.
#[test]
fn a_sequence_that_carries_goes_on_to_the_same_bits() {
    ["forward", "backward"].into_iter().for_each(carries_and_goes_on);
}

fn carries_and_goes_on(way: &str) {
    let folder = stage();
    let words = |more: &str| {
        format!("--reproject {way} --reproject-error 1 --frames 0..48 --only 9..=12 --fps 6 -o a.####.exr {more}")
    };
    let file = |name: &str| folder.path().join(name);
    well(&folder, &words(""));
    let all = ["a.0011.exr", "a.0012.exr"].map(|name| bits(&folder, name));
    let carried = |channels: &[(String, Vec<u32>)]| {
        channels.iter().any(|(name, samples)| name == "carried.samples" && samples.iter().any(|&n| n > 2))
    };
    assert!(all.iter().all(|channels| carried(channels)), "control: frames hold samples of two frames before");
    fs::remove_file(file("a.0011.exr")).unwrap();
    let told = well(&folder, &words(""));
    assert!(told.contains("frame 10: is finished") && told.contains("frame 12: is finished"), "{told}");
    fs::remove_file(file("a.0011.exr")).unwrap();
    fs::remove_file(file("a.0012.exr")).unwrap();
    let told = well(&folder, &words(""));
    assert!(told.contains("frame 10: is finished") && !told.contains("frame 11: is finished"), "{told}");
    assert!(["a.0011.exr", "a.0012.exr"].map(|name| bits(&folder, name)) == all);
    // What is carried is part of what a frame is; the first began with nothing.
    let told = well(&folder, &words("--reproject-samples 9"));
    assert!(told.contains("frame 9: is finished") && !told.contains("frame 10: is finished"), "{told}");
    // So is how it is carried, also where a run begins with a frame that goes on from one before.
    let told = well(
        &folder,
        &words("--only 11..=12").replace("--only 9..=12", "").replace("--reproject-error 1", "--reproject-error 2"),
    );
    assert!(!told.contains("frame 11: is finished"), "{told}");
    // Neither can such a frame go on as an image of its own.
    for words in ["render s.toml --resume a.0012.exr -o r.exr", "merge a.0011.exr a.0012.exr -o m.exr"] {
        let output = tallow(&folder, &words.split_whitespace().collect::<Vec<_>>());
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && line.contains("has samples of earlier frames"), "{words}: {line}");
    }
    // Nothing goes on from a frame with values that no samples have.
    well(&folder, &words(""));
    let mut spoilt = image::read(&file("a.0011.exr")).unwrap();
    let red = spoilt.channels.iter_mut().find(|c| c.name == "R").map(|c| &mut c.samples);
    let Some(Samples::F32(values)) = red else { panic!("no red") };
    values[41] = f32::NAN;
    image::write(&file("a.0011.exr"), &spoilt, &WriteOptions::default()).unwrap();
    fs::remove_file(file("a.0012.exr")).unwrap();
    let output = run(&folder, &words(""));
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(6) && line.contains("pixel (1, 1) has NaN"), "{output:?}");
}

/// Keys call for an effect now and then; a renderer that is made anew for it has no samples to carry.
#[test]
fn effects_of_frames_that_are_not_rendered_change_no_bit() {
    let folder = stage();
    let scene = "[environment]\n[[mesh]]\nshape = 'cube'\nmaterial = 'm'\n\
                 [[mesh]]\nshape = 'rectangle'\ntransform = { translate = [0, 0, -9], scale = 9 }\n\
                 [[material]]\nname = 'm'\ntype = 'conductor'\nalpha = 0.3\n[camera]\nposition = [0, 1, 4]\ntarget = [0, 0, 0]\n\
                 [[animation]]\ncamera = true\nkeys = [{ time = 0, position = [0, 1, 4] }, { time = 8, position = [1, 1, 4] }]\n\
                 [[animation]]\nmaterial = 'm'\ninterpolation = 'step'\nkeys = [{ time = 0, alpha = 0.001 }, \
                 { time = 2, alpha = 0.3 }, { time = 5, alpha = 0.001 }]\n";
    fs::write(folder.path().join("s.toml"), scene).unwrap();
    let words = |more: &str| format!("--fps 1 --reproject forward --reproject-error 1 --quiet {more}");
    let check = |whole: &str, parts: &str, numbers: std::ops::Range<u32>| {
        for n in numbers {
            let [a, b] = [whole, parts].map(|name| bits(&folder, &name.replace('#', &n.to_string())));
            assert!(a == b, "frame {n} of {parts}");
        }
    };
    well(&folder, &words("--frames 0..7 -o a.#.exr"));
    well(&folder, &words("--frames 0..3 -o b.#.exr"));
    well(&folder, &words("--frames 0..7 -o b.#.exr"));
    check("a.#.exr", "b.#.exr", 0..7);
    let carried = |(name, samples): &(String, Vec<u32>)| name == "carried.samples" && samples.iter().any(|&n| n > 0);
    assert!(bits(&folder, "a.5.exr").iter().any(carried), "control: the frame of the last key carries samples");
    // Only the first frames call for a smooth interface before the last key.
    [5, 6].iter().for_each(|n| fs::remove_file(folder.path().join(format!("a.{n}.exr"))).unwrap());
    well(&folder, &words("--frames 0..7 --only 3..7 -o a.#.exr"));
    check("b.#.exr", "a.#.exr", 5..7);
}

#[test]
fn without_frames_all_of_the_animation_is_rendered() {
    let folder = stage();
    let told = well(&folder, "--fps 1 -o n.#.png");
    assert!(told.contains("frame 2: ") && !told.contains("frame 3"), "{told}");
    let told = well(&folder, "--fps 0.1 -o long.#.png");
    assert!(told.contains("frame 0: ") && !told.contains("frame 1"), "a frame may last longer than all keys: {told}");
    let still = "[[mesh]]\nshape = \"cube\"\n[environment]\n";
    fs::write(folder.path().join("s.toml"), still).unwrap();
    let refused = |said: &str| {
        let output = run(&folder, "-o n.#.png --turntable 90 --quiet");
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && line.contains(said), "{line}");
    };
    refused("nothing moves; give --frames");
    let one_key = format!("{still}[[animation]]\ncamera = true\nkeys = [{{ time = 0, position = [0, 0, 9] }}]\n");
    fs::write(folder.path().join("s.toml"), one_key).unwrap();
    refused("what moves has no key after time 0; give --frames 0..1");
    for (frames, is_told) in [("0..2", true), ("0..1", false)] {
        let output = run(&folder, &format!("-o one.#.png --frames {frames}"));
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        let told = line.contains("warning: all frames are alike: what moves has no key after time 0");
        assert!(output.status.success() && told == is_told, "{frames}: {line}");
    }
}

/// A pose at a key is that of all times where there is no other, and keys may lie after all frames, before them, or between two of them.
#[test]
fn frames_that_no_key_moves_are_told() {
    let folder = stage();
    let key = |time: f64| format!("{{ time = {time}, position = [{time}, 0, 9] }}");
    let told = |times: &[f64], more: &str, words: &str| {
        let keys = times.iter().map(|&time| key(time)).collect::<Vec<_>>().join(", ");
        let scene =
            format!("[environment]\n[[mesh]]\nshape = 'cube'\n[[animation]]\ncamera = true\nkeys = [{keys}]\n{more}");
        fs::write(folder.path().join("s.toml"), scene).unwrap();
        let output = run(&folder, &format!("--fps 2 -o n.#.png {words}"));
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success() && line.lines().count() <= 1, "{line}");
        line
    };
    let one = told(&[5.0], "", "--frames 0..2");
    assert!(
        one.contains("all frames are alike: what moves has no second key to move to, and its last is at 5 s"),
        "{one}"
    );
    let later = told(&[5.0, 6.0], "", "--frames 0..2");
    assert!(later.contains("all frames are alike: they are from 0 s to 0.5 s, and keys from 5 s to 6 s"), "{later}");
    let before = told(&[0.0, 1.0], "", "--frames 2..4");
    assert!(
        before.contains("they are from 1 s to 1.5 s, and keys from 0 s to 1 s (choose others by --frames"),
        "{before}"
    );
    let light =
        "[[light]]\ntype = 'point'\nname = 'l'\nintensity = 1\nposition = [0, 3, 0]\n[[animation]]\nlight = 'l'\n";
    let lit = format!("{light}keys = [{{ time = 9, position = [0, 3, 0] }}, {{ time = 10, position = [0, 4, 0] }}]\n");
    let gap = told(&[0.0, 1.0], &lit, "--frames 8..13");
    assert!(
        gap.contains("they are from 4 s to 6 s, and no key moves anything between them (choose others by"),
        "{gap}"
    );
    for (times, more, words) in [
        (&[0.0, 1.0][..], "", "--frames 1..3"),
        (&[0.0, 1.0], "repeat = true\n", "--frames 3..5"),
        (&[0.5, 1.0], "", "--frames 1..3"),
        // A frame alone is what was asked for, and a turntable moves.
        (&[5.0, 6.0], "", "--frames 7"),
        (&[5.0], "", "--frames 3"),
        (&[5.0], "", "--frames 0..2 --turntable 90"),
    ] {
        let line = told(times, more, words);
        assert!(!line.contains("alike"), "{words}: {line}");
    }
}

/// Seconds are whole numbers here, so that angles have the same bits.
#[test]
fn a_turn_is_over_all_frames_whichever_is_the_first() {
    let folder = stage();
    let scene = fs::read_to_string(folder.path().join("s.toml")).unwrap();
    fs::write(folder.path().join("s.toml"), scene.split("[[animation]]").next().unwrap()).unwrap();
    let words = "--turntable 360 --fps 1 --reproject off --quiet";
    well(&folder, &format!("{words} --frames 0..4 -o a.#.exr"));
    well(&folder, &format!("{words} --frames 3..7 --only 3..6 -o b.#.exr"));
    for frame in 0..3 {
        let [a, b] = [format!("a.{frame}.exr"), format!("b.{}.exr", frame + 3)].map(|name| bits(&folder, &name));
        assert!(a == b, "frame {frame}");
        assert!(a != bits(&folder, &format!("a.{}.exr", frame + 1)), "control: frame {frame} is the next");
    }
}

/// A matrix says where the camera stands and not what it looks at: that is what lies before it.
#[test]
fn a_turn_is_about_what_the_camera_looks_at() {
    let folder = stage();
    let scene = "[environment]\n[[mesh]]\nname = 's'\nshape = 'cube'\n\
                 [[instance]]\nmesh = 's'\ntransform = { translate = [5, 0, 0], rotate = [0, 20, 0] }\n\
                 [[instance]]\nmesh = 's'\ntransform = { translate = [-5, 0, 0] }\n[camera]\n";
    let turned = |camera: &str, name: &str| {
        fs::write(folder.path().join("s.toml"), format!("{scene}{camera}\n")).unwrap();
        well(&folder, &format!("--turntable 360 --frames 0..4 --fps 1 --reproject off --quiet -o {name}.#.exr"));
        let film = |n: u32| image::read(&folder.path().join(format!("{name}.{n}.exr"))).unwrap();
        (0..4).map(|n| film(n).picture(Some("Z")).unwrap().pixels).collect::<Vec<_>>()
    };
    let at = turned("position = [5, 0, 6]\ntarget = [5, 0, 0]", "t");
    let through = turned("world_from_camera = [1, 0, 0, 5, 0, 1, 0, 0, 0, 0, 1, 6, 0, 0, 0, 1]", "m");
    let middle = |depths: &[[f32; 3]]| depths[12 * 40 + 20][0];
    for (n, (a, b)) in at.iter().zip(&through).enumerate() {
        assert!(
            (middle(a) - middle(b)).abs() < 0.01 && (1.0..6.0).contains(&middle(a)),
            "frame {n}: {} {}",
            middle(a),
            middle(b)
        );
    }
}

/// What moves stays in view of a camera that the scene does not place, whichever frames are rendered.
#[test]
fn a_camera_without_position_has_what_moves_in_view() {
    let folder = stage();
    let scene = "[environment]\n[[mesh]]\nname = 'c'\nshape = 'cube'\nmaterial = 'm'\n[[material]]\nname = 'm'\ncolor = 0\n\
                 [[animation]]\ninstance = 'c'\nkeys = [{ time = 0, translate = [0, 0, 0] }, { time = 3, translate = [9, 6, 0] }]\n";
    let write = |more: &str| fs::write(folder.path().join("s.toml"), format!("{scene}{more}")).unwrap();
    let words = "--frames 0..4 --fps 1 --reproject off --quiet";
    write("");
    well(&folder, &format!("{words} -o a.#.exr"));
    for n in 0..4 {
        let pixels = image::read(&folder.path().join(format!("a.{n}.exr"))).unwrap().picture(None).unwrap().pixels;
        let black = |i: &usize| pixels[*i] == [0.0; 3];
        let edge = |i: &usize| [0, 24].contains(&(i / 40)) || [0, 39].contains(&(i % 40));
        assert!((0..1000).any(|i| black(&i)) && !(0..1000).filter(edge).any(|i| black(&i)), "frame {n}");
    }
    well(&folder, &format!("{words} --only 2 -o b.#.exr"));
    assert!(bits(&folder, "a.2.exr") == bits(&folder, "b.2.exr"));
    // Nor does one breathe whose field of view has keys.
    write("[[animation]]\ncamera = true\nkeys = [{ time = 0, fov = 40 }]\n");
    well(&folder, &format!("{words} --only 2 -o k.#.exr"));
    assert!(bits(&folder, "a.2.exr") == bits(&folder, "k.2.exr"));
}

#[test]
#[cfg(unix)]
fn a_name_that_is_no_text_is_refused() {
    use std::os::unix::ffi::OsStringExt;
    let folder = stage();
    let odd = |name: &[u8]| std::ffi::OsString::from_vec(name.to_vec());
    fs::copy(folder.path().join("s.toml"), folder.path().join(odd(b"s\xe9.toml"))).unwrap();
    for (scene, more) in [("s.toml".into(), vec!["-o".into(), odd(b"f\xe9.##.exr")]), (odd(b"s\xe9.toml"), Vec::new())]
    {
        let mut sequence = std::process::Command::new(env!("CARGO_BIN_EXE_tallow"));
        sequence.arg("sequence").arg(scene).args(SMALL.split(' ')).args(["--frames", "0..2"]).args(more);
        complains(&sequence.current_dir(folder.path()).output().unwrap(), 2, &["\u{fffd}", "UTF-8"]);
    }
}

#[test]
fn help_leaves_out_what_a_sequence_refuses() {
    let help = stdout(&tallow(&stage(), &["sequence", "--help"]));
    for option in ["--checkpoint ", "--resume ", "--pixel ", "--plan "] {
        assert!(!help.contains(option), "{option}: {help}");
    }
    assert!(help.contains("--heatmap "), "control: {help}");
}

#[test]
fn a_frame_that_fails_does_not_stop_the_others() {
    let folder = stage();
    fs::create_dir(folder.path().join("f.0001.exr")).unwrap();
    let output = run(&folder, "--frames 0..3 -o f.####.exr --preview f.gif");
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(line.starts_with("error: frame 1: f.0001.exr") && line.contains("f.gif lacks it"), "{line}");
    let output = run(&folder, "--frames 0..3 -o f.####.exr --json");
    let line = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!line.contains("lacks it"), "{line}");
    assert_eq!(output.status.code(), Some(6), "{line}");
    assert!(line.starts_with("error: frame 1: f.0001.exr") && line.lines().count() == 1, "{line}");
    assert!(folder.path().join("f.0002.exr").is_file());
    let summary: serde_json::Value = serde_json::from_str(&stdout(&output)).unwrap();
    assert_eq!((&summary["failed"], summary["frames"].as_array().unwrap().len()), (&1.into(), 3));
    assert_eq!(summary["interrupted"], false);
}

#[test]
fn the_pose_of_a_frame_is_read_for_that_frame_alone() {
    let folder = stage();
    let object = |x: f32| format!("v {x} 0 0\nv {} 0 0\nv {x} 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n", x + 1.0);
    for (file, x) in [("base.obj", 0.0), ("p2.obj", 1.0), ("p3.obj", 2.0)] {
        fs::write(folder.path().join(file), object(x)).unwrap();
    }
    let scene = "[environment]\nradiance = 1\n[[mesh]]\nname = \"m\"\nfile = \"base.obj\"\n\
        [[animation]]\nmesh = \"m\"\nfile = \"p#.obj\"\nfirst = 1\nlast = 3\nfps = 24\n";
    fs::write(folder.path().join("s.toml"), scene).unwrap();
    let output = run(&folder, "--frames 0..3 -o f.#.exr");
    complains(&output, 6, &["frame 0: ", "p1.obj: cannot be read"]);
    assert!(["f.1.exr", "f.2.exr"].iter().all(|file| folder.path().join(file).is_file()));
    well(&folder, "--frames 0..3 --only 1..3 -o g.#.exr");
    assert!(
        bits(&folder, "g.2.exr") == bits(&folder, "f.2.exr") && bits(&folder, "g.2.exr") != bits(&folder, "g.1.exr")
    );
}

#[test]
fn options_that_cannot_be_are_one_line() {
    let folder = stage();
    for (words, part) in [
        ("--frames 0..3 -o f.exr", "choose a name as f.####.exr"),
        ("--frames 0..3 -o f", "choose a name as f.####.exr"),
        ("--frames 3..3", "no frame lies from 3 on and before 3"),
        ("--frames 0..3 --only 5", "none of the frames"),
        ("--frames 0..4000000000", "4000000000 frames are more than 1000000"),
        ("--frames 0..3 -o n/p.%03d.exr", "choose a name as n/p.###.exr"),
        ("--frames 0..3 -o p.##.####.exr", "p.##.####.exr: has two places for the number of the frame"),
        ("--frames 0..3 --fps 0", "'0' for '--fps <FPS>': choose a number above 0"),
        ("--frames 0..3 --fps 1e9", "choose a number above 0, at most 1000000"),
        ("--frames 0..3 --fps 30/0", "choose a number above 0"),
        ("--frames 0..3 --pixel 1,1", "--pixel is for one image"),
        ("--frames 0..3 --checkpoint 1", "--checkpoint is for one image"),
        ("--error .02", "--error is for one image: leave it out, or use tallow render"),
        ("--time 2s --pixel 1,1 --denoise auto", "is for one image"),
        ("--frames 0..3 --min-spp 1 --max-spp 1", "max-spp is 1: the policy uniform"),
        ("--frames 0..3 --preview a.png", "a preview goes to a .gif"),
        ("--only 99999", "none of the frames"),
        ("--frames 0..3 --reproject forward --max-spp 9", "set neither noise_threshold nor max_spp"),
        (
            "--frames 0..11 -o p.#.png --heatmap p.##.png",
            "--heatmap p.10.png is the same file as -o: choose another name",
        ),
        ("--frames 0..11 -o p#.png -o p1#.hdr -o ./p1#.png", "-o p10.png is the same file as -o of another frame"),
        ("--frames 0..3 --reproject-error -1", "reproject-error is -1: choose 0 or more"),
    ] {
        let output = run(&folder, words);
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && line.contains(part) && line.lines().count() == 1, "{words}: {line}");
    }
}
