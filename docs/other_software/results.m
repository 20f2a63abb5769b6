% Means over people by timing point, and a mixed model, from a results folder of jointz.
% Runs in MATLAB and in GNU Octave. Put this file beside the folder, or change its name here.
folder = 'results';

% Read every column as text first: Octave has no readtable.
lines = strsplit(strtrim(fileread(fullfile(folder, 'estimates.csv'))), {sprintf('\r\n'), sprintf('\n')});
cells = cellfun(@(x) strsplit(x, ',', 'CollapseDelimiters', false), lines(:), 'UniformOutput', false);
cells = vertcat(cells{:});  % fails if a name contains a comma
column = @(name) cells(2:end, strcmp(cells(1, :), name));
value = str2double(column('value'));  % an empty cell becomes NaN
ok = strcmp(column('status'), 'ok');
fprintf('%d of %d rows have status ok\n', sum(ok), numel(ok));

participant = column('participant');
timing_point = column('timing_point');
parameter = column('parameter');
[participant, timing_point, parameter, value] = ...
    deal(participant(ok), timing_point(ok), parameter(ok), value(ok));

% One row a person: the mean over the sessions and sides of the person.
[~, first, person] = unique(strcat(parameter, {','}, timing_point, {','}, participant));
value = accumarray(person(:), value, [], @mean);
[participant, timing_point, parameter] = ...
    deal(participant(first), timing_point(first), parameter(first));

[~, first, group] = unique(strcat(parameter, {','}, timing_point));
fprintf('timing_point,parameter,mean,sd,people\n');
for k = 1:numel(first)
    x = value(group == k);
    fprintf('%s,%s,%.9g,%.9g,%d\n', timing_point{first(k)}, parameter{first(k)}, ...
        mean(x), std(x), numel(x));
end

% Does stiffness differ between timing points within people? fitlme: Statistics Toolbox.
if exist('fitlme', 'file')
    rows = strcmp(parameter, 'stiffness');
    data = table(value(rows), categorical(timing_point(rows)), categorical(participant(rows)), ...
        'VariableNames', {'value', 'timing_point', 'participant'});
    fit = fitlme(data, 'value ~ timing_point + (1 | participant)', 'FitMethod', 'REML');
    disp(fit)
    disp(anova(fit, 'DFMethod', 'satterthwaite'))
end
