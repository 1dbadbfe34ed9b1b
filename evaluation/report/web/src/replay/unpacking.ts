// Reads what `evaluation/report/page/packing.py` packed.

/** Whole numbers in groups of seven bits, the lowest first. */
export class Numbers {
  private place = 0;

  constructor(private readonly bytes: Uint8Array) {}

  get isAtEnd(): boolean {
    return this.place >= this.bytes.length;
  }

  /** Returns the next number from 0 on. */
  next(): number {
    let value = 0;
    let scale = 1;
    for (;;) {
      const byte = this.bytes[this.place++];
      if (byte === undefined) throw new Error("a replay of the page breaks off; make the page again");
      value += (byte & 127) * scale;
      if (byte < 128) return value;
      scale *= 128;
    }
  }

  /** Returns the next number with a sign. */
  signed(): number {
    const value = this.next();
    return value % 2 === 0 ? value / 2 : -(value + 1) / 2;
  }
}

export type Packed<Header> = { header: Header; streams: ReadonlyMap<string, Uint8Array> };

/** Returns header and streams of a packed text. */
export async function unpack<Header>(text: string): Promise<Packed<Header>> {
  const bytes = await inflated(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)));
  const size = new DataView(bytes.buffer, bytes.byteOffset).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size))) as
    Header & { streams: [string, number][] };
  const streams = new Map<string, Uint8Array>();
  let place = 4 + size;
  for (const [name, length] of header.streams) {
    streams.set(name, bytes.subarray(place, place + length));
    place += length;
  }
  return { header, streams };
}

async function inflated(bytes: Uint8Array<ArrayBuffer>): Promise<Uint8Array> {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** Returns numbers that were packed as differences, column by column, one row for each time. */
export function columns(bytes: Uint8Array, width: number, unit: number): Float64Array {
  const found: number[] = [];
  const numbers = new Numbers(bytes);
  while (!numbers.isAtEnd) found.push(numbers.signed());
  const rows = found.length / width;
  const values = new Float64Array(found.length);
  for (let column = 0; column < width; column++) {
    let sum = 0;
    for (let row = 0; row < rows; row++) {
      sum += found[column * rows + row] ?? 0;
      values[row * width + column] = sum * unit;
    }
  }
  return values;
}

/** Returns ranges, each packed less that of the beam before. */
export function scanRanges(bytes: Uint8Array, beams: number, unit: number): Float32Array {
  const found: number[] = [];
  const numbers = new Numbers(bytes);
  for (let sum = 0; !numbers.isAtEnd;) {
    sum = found.length % beams === 0 ? numbers.signed() : sum + numbers.signed();
    found.push(sum);
  }
  return Float32Array.from(found, (value) => value * unit);
}
