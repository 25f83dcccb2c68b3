#!/usr/bin/env perl
# A stranger's tool for RTUBench in Perl: the length that a function code foretells, and the CRC. No times, no learning.
use strict;
use warnings;
use JSON::PP;

my $json = JSON::PP->new->canonical;
my ($task, $file) = @ARGV;

if ($task eq 'about') {
    print $json->encode({tool => 'lengths.pl', version => '1', input => 'reads',
                         claims => ['frames', 'directions', 'pairs', 'causes', 'texts']}), "\n";
    exit 0;
}

my @table = map { my $v = $_; $v = $v & 1 ? $v >> 1 ^ 0xA001 : $v >> 1 for 1 .. 8; $v } 0 .. 255;

sub crc_ok {
    my $crc = 0xFFFF;
    $crc = $crc >> 8 ^ $table[($crc ^ $_) & 0xFF] for unpack 'C*', $_[0];
    return $crc == 0;
}

# Lengths that a frame at this place may have, each with its direction.
sub lengths {
    my ($unit, $function, $count, undef, undef, undef, $written) = unpack 'C7', $_[0];
    return () unless defined $count;
    return (['response', 5]) if $function & 0x80;
    return (['request', 8], ['response', 5 + $count]) if $function <= 4;
    return (['request', 8], ['response', 8]) if $function == 5 || $function == 6 || $function == 8;
    return (['response', 8], ['request', 9 + ($written // 0)]) if $function == 15 || $function == 16;
    return (['request', 10], ['response', 10]) if $function == 22;
    return (['response', 5 + $count], ['request', 13 + (unpack('x10 C', $_[0] . "\0" x 11) // 0)]) if $function == 23;
    return (['request', 4], ['response', 5 + $count]) if $function == 17;
    return (['request', 4], ['response', 5]) if $function == 7;
    return ();
}

# Frames of a stretch of bytes: [start, length, direction, start of the request or undef].
sub frames {
    my ($data) = @_;
    my ($at, $asked, @found) = (0, undef);
    while ($at < length($data) - 3) {
        my $rest = substr $data, $at, 300;
        my @fits = grep { $_->[1] <= length $rest && crc_ok(substr $rest, 0, $_->[1]) } lengths($rest);
        if (!@fits) { $at++; next }
        my $answers = $asked && ord($rest) == $asked->[1] && (ord(substr $rest, 1, 1) & 0x7F) == $asked->[2];
        my ($fit) = grep { $_->[0] eq ($answers ? 'response' : 'request') } @fits;
        $fit //= $fits[0];
        my ($direction, $length) = @$fit;
        push @found, [$at, $length, $direction, $direction eq 'response' && $answers ? $asked->[0] : undef];
        $asked = $direction eq 'request' ? [$at, unpack 'C2', $rest] : undef;
        $at += $length;
    }
    return @found;
}

sub bytes_of {
    my ($path) = @_;
    open my $in, '<', $path or die "$path: $!\n";
    <$in>;
    return join '', map { pack 'H*', $json->decode($_)->{hex} } <$in>;
}

# Counting: who never answers, who refuses, how much is no frame.
sub causes {
    my ($data) = @_;
    my (%asked, %answered, %refused, $framed);
    for (frames($data)) {
        my ($start, $length, $direction) = @$_;
        my ($unit, $function, $code) = unpack 'C3', substr $data, $start, 3;
        $framed += $length;
        $direction eq 'request' ? $asked{$unit}++ : $answered{$unit}++;
        $refused{$function & 0x80 ? $code : 0}{$unit}++ if $direction eq 'response';
    }
    my @silent = grep { $_ && $asked{$_} > 5 && !$answered{$_} } sort { $a <=> $b } keys %asked;
    return map { {cause => 'unit-silent', units => [$_ + 0]} } @silent if @silent;
    for ([6, 'unit-busy'], [2, 'missing-registers']) {
        my ($code, $word) = @$_;
        my @units = map { $_ + 0 } sort { $a <=> $b } keys %{$refused{$code} // {}};
        return {cause => $word, units => \@units} if @units;
    }
    return {cause => 'line-noise', units => []} if $framed && $framed < 0.98 * length $data;
    return ();
}

if ($task eq 'bus') {
    print $json->encode({start => $_->[0], length => $_->[1], crc_ok => JSON::PP::true, direction => $_->[2],
                         request_start => $_->[3]}), "\n" for frames(bytes_of($file));
} elsif ($task eq 'causes') {
    print $json->encode($_), "\n" for causes(bytes_of($file));
} elsif ($task eq 'text') {
    open my $in, '<:encoding(UTF-8)', $file or die "$file: $!\n";
    my $text = join '', <$in>;
    my $data = join '', map { chr hex } $text =~ /(?<![0-9A-Za-z])(?:0x)?([0-9A-Fa-f]{2})(?![0-9A-Za-z])/g;
    print $json->encode({hex => unpack('H*', substr $data, $_->[0], $_->[1]), direction => $_->[2]}), "\n" for frames($data);
} else {
    die "$task: not claimed\n";
}
