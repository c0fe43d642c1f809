//! Letters of 3 x 5 pixels.

/// Of each character its rows from the top, three bits each, the left pixel first.
const LETTERS: &str = "\
A25755 B65656 C34443 D65556 E74647 F74644 G34553 H55755 I72227 J11152 K55655 L44447 M57755 N65555 O25552 P65644 Q25563 \
R65655 S34216 T72222 U55557 V55552 W55775 X55255 Y55222 Z71247 025552 126227 271747 361216 455711 574616 634652 712222 \
825252 925316";

/// Calls `dot` with the place of every pixel of `text`, which is 4 pixels wide for each letter.
pub fn write(text: &str, mut dot: impl FnMut(u32, u32)) {
    for (index, letter) in text.to_uppercase().chars().enumerate() {
        let rows = LETTERS.split(' ').find(|entry| entry.starts_with(letter)).map_or("00000", |entry| &entry[1..]);
        for (y, row) in rows.chars().filter_map(|c| c.to_digit(8)).enumerate() {
            (0..3).filter(|x| row >> (2 - x) & 1 == 1).for_each(|x| dot(4 * index as u32 + x, y as u32));
        }
    }
}
