// A standard normal deviate from 32 random bits, by inversion: PPND7 of
// Wichura, "Algorithm AS 241", Applied Statistics 37(3), 1988. The top bit is
// the sign, the others a tail probability in (0, 1/2), so deviates reach 6.3
// standard deviations. Counterpart: `sim-gpu/src/cpu/random.rs`.

const PER_2_32: f32 = 1.0 / 4294967296.0;

fn normal_deviate(bits: u32) -> f32 {
    let k = bits & 0x7FFFFFFFu;
    let q = (f32(0x80000000u - k) - 0.5) * PER_2_32;
    var z: f32;
    if q <= 0.425 {
        let r = 0.180625 - q * q;
        z = q * (((59.10937472 * r + 159.29113202) * r + 50.434271938) * r + 3.3871327179)
            / (((67.1875636 * r + 78.757757664) * r + 17.895169469) * r + 1.0);
    } else {
        let r = sqrt(-log((f32(k) + 0.5) * PER_2_32)) - 1.6;
        z = (((0.17023821103 * r + 1.3067284816) * r + 2.75681539) * r + 1.4234372777)
            / ((0.12021132975 * r + 0.7370016425) * r + 1.0);
    }
    return select(z, -z, bits >= 0x80000000u);
}
